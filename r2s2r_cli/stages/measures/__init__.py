"""The measures of the design, computed the same way everywhere: errors, gap, baselines, floor, intervals."""

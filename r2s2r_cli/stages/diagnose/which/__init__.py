"""Stage 2 of a diagnosis: which unmodelled effect explains the gap, against its rivals."""

"""Stage 3 of a diagnosis: how far the gap shrinks on intervals that nothing was fitted to or chosen by."""

"""The score of a stretch: Student's t over all its numbers together, so that one tip-over does not decide."""

from __future__ import annotations

import numpy as np

DOF = 4.0
"""Of Student's t over a stretch: how much its scale may differ from the stated one."""


def minus_log(squares: np.ndarray, size: np.ndarray) -> np.ndarray:
    """-log density up to a constant, of sums of squares (..., stretch) of `size` (stretch,) white numbers."""
    return 0.5 * (DOF + size) * np.log1p(squares / DOF)


def weight(squares: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Of each stretch in re-weighted least squares, (..., stretch): 1 where it is as large as noise makes it."""
    return (DOF + size) / (DOF + squares)

"""Values as an artifact holds them: columns of numbers and of words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def texts(words: Sequence[str]) -> np.ndarray:
    """Words as an artifact holds them: fixed-length UTF-8."""
    return np.char.encode(np.array(words, dtype=str), "utf-8") if len(words) else np.zeros(0, "S1")


def floats(values: Sequence[object]) -> np.ndarray:
    """Numbers in any nesting, as float64."""
    return np.array(values, dtype=float)

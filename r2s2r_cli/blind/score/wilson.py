"""Intervals of shares and of medians."""

from __future__ import annotations

import math

import numpy as np

Z95 = 1.959963984540054


def wilson(right: int, n: int, z: float = Z95) -> tuple[float, float]:
    """Wilson's interval of a share of `right` in n > 0 (Wilson 1927): never outside 0 .. 1, not of width 0 at its
    ends."""
    p = right / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def bootstrap(values: np.ndarray, of: str, draws: int = 2000, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the `mean` or `median` of values (n,), n > 0, by drawing them again. Infinite ones count."""
    rng = np.random.default_rng(seed)
    drawn = values[rng.integers(0, len(values), (draws, len(values)))]
    found = np.sort(np.median(drawn, axis=1) if of == "median" else drawn.mean(axis=1))
    # By place, not by interpolation: between two infinite values there is nothing.
    return float(found[round(0.025 * (draws - 1))]), float(found[round(0.975 * (draws - 1))])

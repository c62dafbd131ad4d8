"""Intervals of shares, of medians and of means."""

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


def of_median(values: np.ndarray) -> tuple[float, float]:
    """95 % interval of the median of values (n,), n > 0, by order statistics: as many values lie below the median as
    heads fall in n throws of a coin, so it holds for every distribution (Thompson 1936). Of fewer than six values no
    interval holds it that surely: without end then. Infinite values count."""
    from scipy.special import bdtr

    n, ordered = len(values), np.sort(values)
    cut = int(np.searchsorted(bdtr(np.arange(n), n, 0.5), 0.025))
    return (float(ordered[cut - 1]), float(ordered[n - cut])) if cut else (-math.inf, math.inf)


def bootstrap(values: np.ndarray, draws: int = 2000, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the mean of values (n,), n > 0, by drawing them again; of one value without end."""
    if len(values) < 2:
        return -math.inf, math.inf
    rng = np.random.default_rng(seed)
    found = np.sort(values[rng.integers(0, len(values), (draws, len(values)))].mean(axis=1))
    return float(found[round(0.025 * (draws - 1))]), float(found[round(0.975 * (draws - 1))])

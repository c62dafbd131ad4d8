"""Whether residuals are noise: correlation along each segment and cap, and constant offsets.

White residuals leave nothing to explain. Correlated ones mean a tracker that drifts, physics that is missing, or
parameters that make up for it; then intervals that count every frame as independent are too narrow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LAGS = 3
GAP = 1.5
"""Frames further apart than this many median gaps are no neighbours."""
DRAWS = (400, 4000)
"""Shuffles of a series: of every one, and of one that few of those are as correlated as."""
COUNTED = 12
"""Shuffles as correlated as the series, from which their share is its chance."""
LEAST = 5
"""Frames of a series below which nothing is said."""


@dataclass(frozen=True)
class Whiteness:
    """Of series, sorted by number. series: (s,); frames: (s,). lag1: correlation of neighbours, means taken out, minus
    that of shuffled frames; lag1_sd: of these. p: that white noise is as correlated over `LAGS` lags.
    offset: mean, (s, axis); p_offset: that noise without offset has as large a mean. white, centred: not refused at 5 %
    over all series (Holm 1979). Series that are too short have nan, and count as white and centred. p_all: that lag1 of
    white noise is as positive in all series together (Stouffer 1949): short ones show little each; nan without any.
    """

    series: np.ndarray
    frames: np.ndarray
    lag1: np.ndarray
    lag1_sd: np.ndarray
    p: np.ndarray
    offset: np.ndarray
    p_offset: np.ndarray
    white: np.ndarray
    centred: np.ndarray
    p_all: float


def whiteness(
    residual: np.ndarray, series: np.ndarray, t: np.ndarray, *, level: float = 0.05, lags: int = LAGS, seed: int = 0
) -> Whiteness:
    """Of residuals (row, axis) at stamps t (row,); rows with one number in series (row,) are one segment of one cap.

    The axes of a cap share a test. Correlation is the Ljung-Box statistic (1978) summed over axes, over pairs of frames
    whose distance is that many median gaps, within half of one. Its chance is found by shuffling the frames of the
    series, since they are few and irregular, with a gamma distribution of the same mean and variance beyond the last.
    """
    from scipy.special import betainc, ndtr

    residual = residual[:, None] if residual.ndim == 1 else residual
    names = np.unique(series)
    count = len(names)
    lag1, lag1_sd, p, p_offset = (np.full(count, np.nan) for _ in range(4))
    offset, frames = np.full((count, residual.shape[1]), np.nan), np.zeros(count, dtype=int)
    rng = np.random.default_rng(seed)
    for k, name in enumerate(names):
        rows = np.flatnonzero(series == name)
        rows = rows[np.argsort(t[rows], kind="stable")]
        e = residual[rows]
        n, axes = e.shape
        frames[k] = n
        if n < LEAST:
            continue
        offset[k] = e.mean(axis=0)
        near = _pairs(t[rows], lags)
        e = e - offset[k]
        power = np.sum(e**2, axis=0)
        # A constant residual has no noise to compare with.
        if not np.all(power > 0) or not len(near[0]):
            continue
        e = e / np.sqrt(power)
        shuffled = e[rng.permuted(np.tile(np.arange(n), (DRAWS[0], 1)), axis=1)]
        first = np.mean(_products(np.concatenate([e[None], shuffled]), near[0]), axis=1) * n / len(near[0])
        lag1[k], lag1_sd[k] = first[0] - first[1:].mean(), first[1:].std()
        p[k] = _chance(e, shuffled, near, rng)
        # Hotelling's one-sample test: the axes' noise may differ and be correlated.
        if n > axes + 1:
            scatter = np.linalg.pinv((residual[rows] - offset[k]).T @ (residual[rows] - offset[k]) / (n - 1))
            f = float(n * offset[k] @ scatter @ offset[k]) * (n - axes) / (axes * (n - 1))
            p_offset[k] = float(betainc((n - axes) / 2, axes / 2, (n - axes) / (n - axes + axes * f)))
    known = lag1_sd > 0
    p_all = float(ndtr(-np.sum(lag1[known] / lag1_sd[known]) / np.sqrt(known.sum()))) if known.any() else np.nan
    return Whiteness(
        names, frames, lag1, lag1_sd, p, offset, p_offset, ~holm(p, level), ~holm(p_offset, level), p_all
    )  # fmt: skip


def holm(p: np.ndarray, level: float = 0.05) -> np.ndarray:
    """(k,) bool: hypotheses refused, with a chance of `level` that any of them is true (Holm 1979); nan: never."""
    refused = np.zeros(len(p), dtype=bool)
    order = np.argsort(np.where(np.isfinite(p), p, np.inf), kind="stable")[: int(np.isfinite(p).sum())]
    for rank, k in enumerate(order):
        if p[k] > level / (len(order) - rank):
            break
        refused[k] = True
    return refused


def _pairs(t: np.ndarray, lags: int) -> list[np.ndarray]:
    """For each lag, the pairs of frames (pair, 2) that are that many median gaps apart, no gap being a long one."""
    gap = np.diff(t)
    usual = float(np.median(gap))
    found = []
    for lag in range(1, lags + 1):
        first = np.arange(len(t) - lag)
        apart = t[lag:] - t[:-lag]
        near = np.abs(apart - lag * usual) <= (GAP - 1.0) * usual
        found.append(np.stack([first[near], first[near] + lag], axis=1))
    return found


def _chance(e: np.ndarray, shuffled: np.ndarray, near: list[np.ndarray], rng: np.random.Generator) -> float:
    """Of a statistic as large from shuffled frames. e: (n, axis), squares sum to 1; shuffled: (draw, n, axis)."""
    from scipy.special import gammaincc

    found, drawn = _correlated(e[None], near)[0], _correlated(shuffled, near)
    above = int(np.sum(drawn >= found))
    if above < COUNTED:
        more = rng.permuted(np.tile(np.arange(len(e)), (DRAWS[1], 1)), axis=1)
        drawn = np.concatenate([drawn, _correlated(e[more], near)])
        above = int(np.sum(drawn >= found))
    if above or np.ptp(drawn) == 0:
        return (above + 1) / (len(drawn) + 1)
    mean, variance = float(drawn.mean()), float(drawn.var())
    return min(float(gammaincc(mean**2 / variance, found * mean / variance)), 1.0 / (len(drawn) + 1))


def _correlated(e: np.ndarray, near: list[np.ndarray]) -> np.ndarray:
    """The statistic of series e (draw, n, axis), up to a factor, (draw,)."""
    q: np.ndarray = np.zeros(len(e))
    for pairs in near:
        if len(pairs):
            q += np.sum(_products(e, pairs) ** 2, axis=1) / len(pairs)
    return q


def _products(e: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Sums of products over pairs of frames, (draw, axis)."""
    found: np.ndarray = np.sum(e[:, pairs[:, 0]] * e[:, pairs[:, 1]], axis=1)
    return found

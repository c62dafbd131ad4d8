"""Intervals by bootstrap over segments, for one predictor and for the difference of two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np

DRAWS = 4000
FEW = 6
"""With fewer segments a 95 % interval covers less than 90 %, see docs/concepts/measures.md."""

Summary = Literal["rms", "mean"]


@dataclass(frozen=True)
class Interval:
    """Two-sided interval [lower, upper] around `value`, from `n` segments; all [m]."""

    value: float
    lower: float
    upper: float
    n: int
    level: float

    @property
    def few(self) -> bool:
        """Whether so few segments stand behind it that it covers less than it says."""
        return self.n < FEW


@dataclass(frozen=True)
class Difference:
    """Ours minus the other [m]: negative where ours is better. ours_better: share of the resamples in which it is."""

    interval: Interval
    ours_better: float


def bootstrap(
    values: np.ndarray, *, summary: Summary = "rms", weights: np.ndarray | None = None, level: float = 0.95,
    draws: int = DRAWS, seed: int = 0,
) -> Interval | None:  # fmt: skip
    """Of one number a segment, (segment,): mean squared errors [m^2] for "rms", errors [m] for "mean".

    weights: (segment,), number of frames for the mean over frames. Segments with NaN (not predicted) are left out.
    Bias-corrected and accelerated (Efron 1987, J. Am. Stat. Assoc. 82, 171), since squared errors are skewed, and
    expanded for small samples (Hesterberg 2015, Am. Stat. 69, 371: quantiles of Student's t times sqrt(n / (n - 1))),
    since segments are few. None for fewer than two segments. Segments of one run count as independent draws of what
    the robot does.
    """
    weights = np.ones(len(values)) if weights is None else weights
    use = np.isfinite(values)
    if use.sum() < 2:
        return None
    of = _summary(summary)
    x, w = values[use], weights[use]
    rows = _resamples(len(x), draws, seed)
    drawn, value = of(x[rows], w[rows]), float(of(x, w))
    others = np.array([of(np.delete(x, i), np.delete(w, i)) for i in range(len(x))])
    lower, upper = _ends(value, drawn, others, level)
    return Interval(value, lower, upper, len(x), level)


def paired(
    ours: np.ndarray, other: np.ndarray, *, summary: Summary = "rms", weights: np.ndarray | None = None,
    level: float = 0.95, draws: int = DRAWS, seed: int = 0,
) -> Difference | None:  # fmt: skip
    """Of two predictors over the same segments, resampled together; arguments as in `bootstrap`.

    Only segments that both predict are compared: interval.n says how many. Resamples in which both are equal count
    half.
    """
    weights = np.ones(len(ours)) if weights is None else weights
    use = np.isfinite(ours) & np.isfinite(other)
    if use.sum() < 2:
        return None
    of = _summary(summary)
    x, y, w = ours[use], other[use], weights[use]

    rows = _resamples(len(x), draws, seed)
    drawn = of(x[rows], w[rows]) - of(y[rows], w[rows])
    value = float(of(x, w) - of(y, w))
    kept = [np.delete(np.arange(len(x)), i) for i in range(len(x))]
    others = np.array([of(x[k], w[k]) - of(y[k], w[k]) for k in kept])
    lower, upper = _ends(value, drawn, others, level)
    return Difference(
        Interval(value, lower, upper, len(x), level), float(np.mean(drawn < 0) + 0.5 * np.mean(drawn == 0))
    )


def upper_bound(values: np.ndarray, *, level: float = 0.90, draws: int = DRAWS, seed: int = 0) -> float | None:
    """One-sided bound of the RMSE [m] of mean squared errors (segment,) [m^2]; None for fewer than two segments."""
    found = bootstrap(values, level=2 * level - 1, draws=draws, seed=seed)
    return None if found is None else found.upper


def _summary(summary: Summary) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Weighted mean over the last axis, its root for "rms"."""

    def mean(x: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.sum(x * w, axis=-1) / np.sum(w, axis=-1)

    return (lambda x, w: np.sqrt(mean(x, w))) if summary == "rms" else mean


def _resamples(n: int, draws: int, seed: int) -> np.ndarray:
    """Rows (draw, segment), drawn with replacement."""
    return np.random.default_rng(seed).integers(0, n, size=(draws, n))


def _ends(value: float, drawn: np.ndarray, others: np.ndarray, level: float) -> tuple[float, float]:
    """Ends of the interval; `others`: the summary with each segment left out in turn."""
    from scipy.stats import t as student

    if np.ptp(drawn) == 0.0:
        return value, value
    normal = NormalDist()
    below = float(np.mean(drawn < value) + 0.5 * np.mean(drawn == value))
    # All draws on one side: a bias that cannot be told is bounded by what this number of draws can tell.
    bias = normal.inv_cdf(min(max(below, 0.5 / len(drawn)), 1.0 - 0.5 / len(drawn)))
    away = others.mean() - others
    spread = float(np.sum(away**2))
    acceleration = float(np.sum(away**3)) / (6.0 * spread**1.5) if spread > 0.0 else 0.0
    ends = []
    n = len(others)
    wide = float(np.sqrt(n / (n - 1)) * student.ppf(0.5 + 0.5 * level, n - 1))
    for quantile in (-wide, wide):
        z = bias + quantile
        ends.append(normal.cdf(bias + z / max(1.0 - acceleration * z, 1e-6)))
    lower, upper = np.quantile(drawn, ends)
    return float(lower), float(upper)

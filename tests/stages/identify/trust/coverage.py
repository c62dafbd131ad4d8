"""Whether reported intervals hold what they promise: coverage and bias over planted cases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Coverage:
    """Share of cases whose interval holds the truth; low, high: 95 % interval of that share (Clopper-Pearson 1934)."""

    hits: int
    cases: int
    share: float
    low: float
    high: float

    def agrees(self, level: float) -> bool:
        """Whether the promised level lies in that interval."""
        return self.low <= level <= self.high


@dataclass(frozen=True)
class Bias:
    """Mean of estimate minus truth, its standard error, and their ratio's size in standard errors: above 3 the bias is
    real. pull_sd: standard deviation of (estimate - truth) / reported sd, 1 where sds are honest; nan without sds."""

    mean: float
    standard_error: float
    cases: int
    pull_sd: float

    @property
    def size(self) -> float:
        """|mean| in standard errors; 0 where both are 0."""
        if self.standard_error > 0:
            return abs(self.mean) / self.standard_error
        return 0.0 if self.mean == 0 else float("inf")


def clopper_pearson(hits: int, cases: int, level: float = 0.95) -> tuple[float, float]:
    """Exact interval of a share; (0, 1) without cases."""
    from scipy.special import betaincinv

    if cases == 0:
        return 0.0, 1.0
    tail = 0.5 * (1.0 - level)
    low = 0.0 if hits == 0 else float(betaincinv(hits, cases - hits + 1, tail))
    high = 1.0 if hits == cases else float(betaincinv(hits + 1, cases - hits, 1.0 - tail))
    return low, high


def coverage(truth: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Coverage:
    """Of intervals of any shape; those with a nan end are no cases: nothing was promised."""
    truth, lower, upper = (np.ravel(one) for one in np.broadcast_arrays(truth, lower, upper))
    given = np.isfinite(truth) & ~np.isnan(lower) & ~np.isnan(upper)
    hits = int(np.sum((lower <= truth)[given] & (truth <= upper)[given]))
    cases = int(given.sum())
    low, high = clopper_pearson(hits, cases)
    return Coverage(hits, cases, hits / cases if cases else float("nan"), low, high)


def bias(estimate: np.ndarray, truth: np.ndarray, sd: np.ndarray | None = None) -> Bias:
    """Over cases (k,); cases with a nan estimate are left out. Raises ValueError for fewer than two cases."""
    error = np.asarray(estimate, dtype=float) - truth
    given = np.isfinite(error)
    if given.sum() < 2:
        raise ValueError("a bias needs two cases or more")
    mean, k = float(error[given].mean()), int(given.sum())
    pull = float("nan")
    if sd is not None:
        usable = given & np.isfinite(sd) & (np.asarray(sd) > 0)
        if usable.sum() >= 2:
            pull = float(np.std(error[usable] / np.asarray(sd)[usable], ddof=1))
    return Bias(mean, float(error[given].std(ddof=1) / np.sqrt(k)), k, pull)

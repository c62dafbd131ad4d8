"""How sure a fit is of its parameters: covariance that also counts what the noise model leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.free.base import Coordinate, Free, slopes_of, values_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.clusters import Inflation, Scores, pooled, sandwich
from r2s2r_cli.stages.identify.trust.information import sd_flat, spectrum, widths
from r2s2r_cli.stages.identify.trust.parts import Parts, parts_of, scores_of

MANY = 20
"""Clusters from which their own scores are the covariance; there must also be twice as many as parameters."""
ALIKE = 0.95
"""Correlation of two parameters that the data can hardly tell apart."""
MOST_Z = 700.0
"""Coordinates beyond overflow."""


@dataclass(frozen=True)
class Covariance:
    """Of p parameters. covariance: (p, p), of z, nuisances marginalised; naive: the same if residuals were independent
    with the variance they were divided by; bread: inverse curvature of the cost. value, sd: (p,), in units. lower,
    upper: (p,), ends of the interval, units. quantile: (p,), of Student's t, that they lie from z in sd_z. inflation:
    variance of the residuals over that of the noise as given. dof: (p,), of its estimate. clusters: that showed it, 0
    where none were given. how: in words. on_bound: names.
    """

    names: tuple[str, ...]
    z: np.ndarray
    covariance: np.ndarray
    naive: np.ndarray
    bread: np.ndarray
    value: np.ndarray
    sd: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    level: float
    quantile: np.ndarray
    inflation: float
    dof: np.ndarray
    clusters: int
    how: str
    on_bound: tuple[str, ...]

    @property
    def sd_z(self) -> np.ndarray:
        """Standard deviations of the coordinates, (p,)."""
        found: np.ndarray = np.sqrt(np.diag(self.covariance))
        return found

    @property
    def correlation(self) -> np.ndarray:
        """Of the coordinates, (p, p); nan beside a parameter that cannot move or of which nothing is known."""
        return correlation_of(self.covariance)

    def alike(self, least: float = ALIKE) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters with a correlation of at least that size, the strongest first."""
        correlation = self.correlation
        pairs = [
            (self.names[j], self.names[i], float(correlation[i, j])) for i in range(len(self.names)) for j in range(i)
        ]
        return tuple(sorted((one for one in pairs if abs(one[2]) >= least), key=lambda one: -abs(one[2])))


def correlation_of(covariance: np.ndarray) -> np.ndarray:
    """Of a covariance (p, p), whose rows may be 0, infinite or nan: the correlation is nan there."""
    sd = np.sqrt(np.diag(covariance))
    sd = np.where((sd > 0) & np.isfinite(sd), sd, np.nan)
    found: np.ndarray = np.clip(covariance / np.outer(sd, sd), -1.0, 1.0)
    return found


def covariance(
    problem: Problem,
    solution: Solution,
    frees: Sequence[Free],
    *,
    loss: Loss = LOSSES["none"],
    block: np.ndarray | None = None,
    cluster: np.ndarray | None = None,
    level: float = 0.95,
    least: float = 1.0,
    drawn: np.ndarray | None = None,
) -> Covariance:
    """Posterior covariance at a solution, in the form bread * meat * bread (Huber 1967, White 1982).

    Bread: inverse curvature of the robust cost with priors. Meat: variance of the scores, that of the data from the
    residuals themselves, that of the priors as they were given, so that a parameter of which the data say nothing keeps
    its prior. Of the data: with `MANY` clusters and twice as many as parameters, their outer products; with fewer, the
    model's, times one inflation, the greater of chi^2 / dof and the pooled one of the clusters.

    block: as in Evaluation, needed with a robust loss. cluster: (m,) int, windows, or segments where windows are few:
    residuals in different ones are independent, but for a start that they share. least: inflation is not below (noise
    may be over-estimated). Intervals are quantiles of Student's t in z, mapped to units and cut at the bounds: not
    symmetric for log and logit. drawn: (n, n), of the unknowns, as candidates showed it (`trust.posterior`): where they
    show more than the curvature, they are believed.
    """
    p = len(problem.names)
    parts = parts_of(problem, solution, loss, block)
    found = None if cluster is None else scores_of(problem, solution, parts, cluster)
    bread, fixed = parts.bread, parts.own_prior
    naive = bread @ (parts.normal * parts.information + fixed) @ bread
    inflation, how = _inflation(solution, parts, found, least)
    total = bread @ (inflation.value * parts.information + fixed) @ bread
    dof = np.full(p, inflation.dof)
    if found is not None and found.count >= max(MANY, 2 * p):
        meat, dof = sandwich(found, bread, parts.information)
        total, how = _no_less(bread @ (meat + fixed) @ bread, total), f"scores of {found.count} windows"
    if drawn is not None:
        total = _no_less(total, drawn[:p, :p])
    unknown = _unknown(parts.curvature, widths(problem, frees))
    total, naive = (_blank(one, unknown) for one in (total, naive))
    quantile = _quantile(level, dof)
    reach = np.where(unknown, np.inf, quantile * np.sqrt(np.maximum(np.diag(total), 0.0)))
    z = solution.z[:p]
    ends = [_ends(free, float(one), float(far)) for free, one, far in zip(frees, z, reach, strict=True)]
    return Covariance(
        names=problem.names, z=z, covariance=total, naive=naive, bread=bread, value=values_of(tuple(frees), z),
        sd=np.sqrt(np.diag(total)) * slopes_of(tuple(frees), z), lower=np.array([low for low, _ in ends]),
        upper=np.array([high for _, high in ends]), level=level, quantile=quantile,
        inflation=inflation.value / parts.normal, dof=dof,
        clusters=0 if found is None else found.count, how=how, on_bound=solution.on_bound,
    )  # fmt: skip


def _inflation(solution: Solution, parts: Parts, found: Scores | None, least: float) -> tuple[Inflation, str]:
    """The greater of chi^2 / dof and what the windows show, but not below `least`; and its name."""
    m, weight = len(solution.residual), solution.weight
    left = m - parts.used
    size = float(np.sum((weight * solution.residual) ** 2) / np.sum(weight))
    candidates = [(Inflation(least * parts.normal, np.inf), "noise as given")]
    if left >= 1.0:
        candidates.append((Inflation(size * m / left, left), "chi^2 / dof of the residuals"))
    of_windows = None if found is None else pooled(found, parts.bread)
    if of_windows is not None and found is not None:
        candidates.append((of_windows, f"pooled scores of {found.count} windows"))
    return max(candidates, key=lambda one: one[0].value)


def _no_less(robust: np.ndarray, model: np.ndarray) -> np.ndarray:
    """The robust covariance, rows and columns raised until no standard deviation is below the model's."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.sqrt(np.diag(model) / np.diag(robust))
    raised = np.where(np.isfinite(share), np.maximum(share, 1.0), 1.0)
    return robust * np.outer(raised, raised)


def _unknown(curvature: np.ndarray, width: np.ndarray) -> np.ndarray:
    """(p,) bool: nothing, not even a prior, says where the parameter is."""
    scaled = curvature * np.outer(width, width)
    found: np.ndarray = ~np.isfinite(sd_flat(*spectrum(scaled))) & (width > 0)
    return found


def _blank(covariance: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    blank = np.where(unknown[:, None] | unknown, np.nan, 0.5 * (covariance + covariance.T))
    blank[np.diag_indices_from(blank)] = np.where(unknown, np.inf, np.diag(covariance))
    return blank


def _quantile(level: float, dof: np.ndarray) -> np.ndarray:
    """Of Student's t, two-sided; normal for infinitely many degrees of freedom. Below one degree, that of one."""
    from scipy.special import ndtri, stdtrit

    upper = 0.5 + 0.5 * level
    finite = np.isfinite(dof)
    found: np.ndarray = np.where(finite, stdtrit(np.where(finite, np.maximum(dof, 1.0), 1.0), upper), ndtri(upper))
    return found


def _ends(free: Free, z: float, reach: float) -> tuple[float, float]:
    """Values at z -+ reach, not beyond the bounds."""
    low, high = max(z - reach, -MOST_Z), min(z + reach, MOST_Z)
    if free.coordinate is Coordinate.LINEAR:
        low, high = z - reach, z + reach
    value = free.from_z(z)
    return min(max(free.from_z(low), free.lower), value), max(min(free.from_z(high), free.upper), value)

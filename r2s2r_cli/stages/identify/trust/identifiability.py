"""Which parameters data can identify: spectrum of the scaled normal matrix, weak directions in words.

Serves before a fit, at its start, and after it, at the solution. Numbers are widths (`information.widths`): 1 is what
prior and bounds think possible.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free.base import Free, slopes_of
from r2s2r_cli.stages.identify.solve.problem import Evaluation, Problem
from r2s2r_cli.stages.identify.trust.information import (
    marginal,
    precision,
    sd_flat,
    sd_given_others,
    spectrum,
    widths,
)
from r2s2r_cli.stages.identify.trust.refuse import NOTHING, refuse_bounds, refuse_hopeless
from r2s2r_cli.stages.identify.trust.words import direction, shrunk

IDENTIFIED = 0.5
"""Data know a parameter to this share of its width: the posterior is at most 0.45 times as wide as the prior."""
WEAK = 1.5
"""Beyond, the posterior is more than 0.83 times as wide as the prior: what is printed would be the prior."""
THRESHOLD = 1.0
"""Information about a direction, in widths^-2, below which prior and bounds say more about it than the data."""
KINK = 3.0
"""A derivative that claims this many times the effect that a finite change has is that of a kink: the change counts."""


class Trust(StrEnum):
    """What a number is worth."""

    IDENTIFIED = "identified"
    WEAK = "weak"
    NOT_IDENTIFIABLE = "not identifiable"
    ON_BOUND = "on a bound"


@dataclass(frozen=True)
class Identifiability:
    """What data say about p parameters at z (p,).

    width: (p,), in z. column_norm: (p,), change of all residuals [sd] for one width, by derivatives; secant_norm: the
    same by finite changes, nan where none was asked for or could be simulated. normal: (p, p), information of the data
    per width, nuisances marginalised. eigenvalue: (p,), rising; eigenvector: (p, p), rows; weak: (p,) bool; words.
    sd_z: (p,), from the data, with the other parameters within their widths; sd: the same in units; sd_flat_z: (p,),
    with nothing known of the others. trust, reason: (p,). no_effect: parameters that change nothing. stalled: those
    without a derivative here, which act further away; rough: those whose derivative is that of a kink: where there are
    any, the cost is rough, and so is every covariance.
    """

    names: tuple[str, ...]
    z: np.ndarray
    width: np.ndarray
    column_norm: np.ndarray
    secant_norm: np.ndarray
    normal: np.ndarray
    eigenvalue: np.ndarray
    eigenvector: np.ndarray
    weak: np.ndarray
    words: tuple[str, ...]
    sd_z: np.ndarray
    sd: np.ndarray
    sd_flat_z: np.ndarray
    trust: tuple[Trust, ...]
    reason: tuple[str, ...]
    no_effect: tuple[str, ...]
    stalled: tuple[str, ...]
    rough: tuple[str, ...]

    @property
    def condition(self) -> float:
        """Largest over smallest eigenvalue that is not 0; nan where all are."""
        known = self.eigenvalue[self.eigenvalue > 0]
        return float(known[-1] / known[0]) if len(known) else float("nan")

    @property
    def weakest(self) -> tuple[int, ...]:
        """Parameters that have an effect, the least known first."""
        order = np.argsort(-self.sd_z, kind="stable")
        return tuple(int(i) for i in order if self.names[i] not in self.no_effect)


def identifiability(
    problem: Problem,
    z0: np.ndarray,
    frees: Sequence[Free],
    *,
    evaluation: Evaluation | None = None,
    weight: np.ndarray | None = None,
    inflation: float = 1.0,
    secant: float | None = 0.3,
    refuse: bool = True,
    excused: Collection[str] = (),
) -> Identifiability:
    """Of the parameters at z0 (n,), nuisances marginalised with their priors, priors of parameters off.

    evaluation: at z0 with its Jacobian, if known. weight: (m,), robust, at a solution. inflation: of the residuals'
    variance over what they were divided by (`covariance`). secant: finite changes, in widths, that check the
    derivatives, two evaluations a parameter; None: no check. A derivative at a kink of contact can be 0 or huge: where
    a finite change shows less than a third of it, or where it is 0, the change takes its place.

    Raises, with `refuse`, InputError for starts on a bound or outside, and for parameters without any effect, but those
    that are `excused` by name.
    Raises NumericalError where z0 cannot be evaluated.
    """
    z0 = np.asarray(z0, dtype=float)
    p = len(problem.names)
    if refuse:
        refuse_bounds(problem, z0, frees)
    if evaluation is None or evaluation.jacobian is None:
        evaluation = problem.evaluate(z0, jacobian=True)
    assert evaluation.jacobian is not None  # noqa: S101 - asked for
    root = np.sqrt((np.ones_like(evaluation.residual) if weight is None else weight) / inflation)
    jacobian = evaluation.jacobian * root[:, None]
    width = widths(problem, frees)
    column_norm = np.linalg.norm(jacobian[:, :p], axis=0) * width
    secant_norm = np.full(p, np.nan)
    if secant is not None:
        jacobian = jacobian.copy()
        for i in range(p):
            column = _secant(problem, z0, i, secant * width[i])
            if column is None:
                continue
            column = column * root
            secant_norm[i] = float(np.linalg.norm(column)) * width[i]
            if column_norm[i] < NOTHING <= secant_norm[i] or column_norm[i] > KINK * secant_norm[i]:
                jacobian[:, i] = column
    rough = column_norm > KINK * np.maximum(secant_norm, NOTHING)
    dead = (column_norm < NOTHING) & ~(secant_norm >= NOTHING)
    stalled = (column_norm < NOTHING) & (secant_norm >= NOTHING)
    if refuse:
        asked = np.array([name not in excused for name in problem.names], dtype=bool)
        refuse_hopeless(problem.names, dead & asked, stalled & asked, column_norm, frees)
    full = jacobian.T @ jacobian
    full[np.diag_indices_from(full)] += np.concatenate([np.zeros(p), precision(problem)[p:]])
    scaled = marginal(full, p) * np.outer(width, width)
    eigenvalue, rows = spectrum(scaled)
    sd_z = sd_given_others(scaled)
    sd_z[dead] = np.inf
    words = tuple(_words(frees, z0[:p], width, rows[k], eigenvalue[k]) for k in range(p))
    weak = eigenvalue < THRESHOLD
    trust = tuple(trust_of(share) for share in left_of(sd_z).tolist())
    reason = tuple(_reason(i, frees, width, sd_z, dead, stalled | rough) for i in range(p))
    return Identifiability(
        problem.names, z0[:p], width, column_norm, secant_norm, scaled, eigenvalue, rows, weak, words,
        sd_z * width, sd_z * width * slopes_of(tuple(frees), z0[:p]), sd_flat(eigenvalue, rows) * width, trust, reason,
        _names(problem.names, dead), _names(problem.names, stalled),
        _names(problem.names, rough),
    )  # fmt: skip


def _secant(problem: Problem, z0: np.ndarray, i: int, step: float) -> np.ndarray | None:
    """Quotient of finite changes of one unknown, (m,), inside its box; None where neither side can be simulated."""
    ends = []
    for sign in (1.0, -1.0):
        z = z0.copy()
        z[i] = np.clip(z0[i] + sign * step, problem.lower[i], problem.upper[i])
        try:
            ends.append((z[i], problem.evaluate(z, jacobian=False).residual))
        except NumericalError:
            continue
    if not ends:
        return None
    if len(ends) == 1:
        ends.append((z0[i], problem.evaluate(z0, jacobian=False).residual))
    (above, high), (below, low) = ends
    if above == below or not np.all(np.isfinite(high - low)):
        return None
    quotient: np.ndarray = (high - low) / (above - below)
    return quotient


def _names(names: tuple[str, ...], which: np.ndarray) -> tuple[str, ...]:
    return tuple(name for name, one in zip(names, which, strict=True) if one)


def _words(frees: Sequence[Free], z: np.ndarray, width: np.ndarray, row: np.ndarray, eigenvalue: float) -> str:
    """The direction, its largest part one width long."""
    step = row / np.abs(row).max()
    seen = float(np.sqrt(eigenvalue) / np.abs(row).max())
    return direction(frees, z, step * width, np.abs(step), seen, weak=bool(eigenvalue < THRESHOLD))


def left_of(sd: np.ndarray) -> np.ndarray:
    """Share of each width that is left by data that know a parameter to sd (p,), in widths."""
    with np.errstate(invalid="ignore"):
        share = sd / np.hypot(1.0, sd)
    found: np.ndarray = np.where(np.isfinite(sd), share, 1.0)
    return found


def trust_of(share: float) -> Trust:
    """The label of a parameter of whose width this share is left."""
    identified, weak = left_of(np.array([IDENTIFIED, WEAK])).tolist()
    if share <= identified:
        return Trust.IDENTIFIED
    return Trust.WEAK if share <= weak else Trust.NOT_IDENTIFIABLE


def _reason(
    i: int,
    frees: Sequence[Free],
    width: np.ndarray,
    sd: np.ndarray,
    dead: np.ndarray,
    finite: np.ndarray,
) -> str:  # fmt: skip
    if dead[i]:
        return "no compared frame depends on it"
    found = shrunk(frees[i], float(width[i]), float(left_of(sd)[i]))
    return found + (" (by a finite change: the derivative here is that of a kink)" if finite[i] else "")

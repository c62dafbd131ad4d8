"""How well a hypothesis predicts gaits that it was not fitted to: leave-one-gait-out log predictive density.

Without a gait the numbers are where one Gauss-Newton step leads from the whole fit; the gait is then really simulated
with them. The predictive covariance has noise, floor, starts and what the other gaits leave unsure of the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import LOST_M, Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits
from r2s2r_cli.stages.diagnose.which.mixture import minus_log

ENOUGH = 12.0
"""[nats]"""


@dataclass(frozen=True)
class Score:
    """elpd (stretch,): log predictive density of each stretch without its gait [nats], up to a constant that all
    hypotheses share. misfit (stretch,): squares over how many there are, 1 where noise and floor explain it. key
    (interval, cap, 3): predicted minus observed caps at its end [m]. sd (n,): of the fitted numbers, all gaits; without
    (group, n): the numbers without each group."""

    elpd: np.ndarray
    misfit: np.ndarray
    key: np.ndarray
    sd: np.ndarray
    without: np.ndarray

    @property
    def squared(self) -> np.ndarray:
        """Mean squared 3-D distance of the caps at the end of each interval, (interval,) [m^2]."""
        return np.asarray(np.sum(self.key**2, axis=-1).mean(axis=-1))


def gains(refit: Score, others: Sequence[Score]) -> np.ndarray:
    """Held-out log density of hypotheses over the refit nominal model, (hypothesis,) [nats]. At a piece none loses more
    than ENOUGH against the best of them all: a robot that tips over, or not, is explained by anything."""
    total = _table(refit, others).sum(axis=1)
    return np.asarray(total[1:] - total[0])


def gain_sds(refit: Score, others: Sequence[Score], groups: np.ndarray) -> np.ndarray:
    """Sd of the gains, (hypothesis,) [nats], from how much the groups differ in what they gain; nan with one group."""
    table = _table(refit, others)
    own = np.stack([(table[1:] - table[0])[:, groups == name].sum(axis=1) for name in np.unique(groups)], axis=1)
    count = own.shape[1]
    return np.sqrt(count) * own.std(axis=1, ddof=1) if count > 1 else np.full(len(own), np.nan)


def _table(refit: Score, others: Sequence[Score]) -> np.ndarray:
    """Log densities (1 + hypothesis, stretch), the refit nominal model first."""
    table = np.array([refit.elpd, *(score.elpd for score in others)])
    return np.asarray(np.logaddexp(table, table.max(axis=0) - ENOUGH))


def groups_of(arena: Arena) -> np.ndarray:
    """What is left out together, (stretch,): gaits; with one gait runs, with one run every interval."""
    if len(set(arena.gait.tolist())) > 1:
        return arena.gait
    runs = list(dict.fromkeys(one.run for one in arena.many))
    if len(runs) > 1:
        return np.array([runs.index(one.run) for one in arena.many])
    places = list(dict.fromkeys((one.run, one.interval) for one in arena.many))
    return np.array([places.index((one.run, one.interval)) for one in arena.many])


def scores(arena: Arena, fits: Sequence[Fit], groups: np.ndarray, *, held_out: bool = True) -> list[Score]:
    """Of every fit, all hypotheses and groups in one batch. held_out: False, nothing is left out (an ablation)."""
    solver = Fits(arena)
    names = np.unique(groups)
    points, precisions = [], []
    for fit in fits:
        own, pull = solver.products(fit)
        H, gradient = solver.normal(fit, (own, pull))
        for name in names:
            out = (groups == name) & held_out
            P = np.linalg.pinv(H - own[out].sum(axis=0), hermitian=True)
            points.append(_placed(arena, fit, P @ (pull[out].sum(axis=0) - gradient)))
            precisions.append(H - own[out].sum(axis=0))
    values = np.concatenate([
        solver.values(fits[i // len(names)].hypothesis, z[None], x[None]) for i, (z, x) in enumerate(points)
    ])  # fmt: skip
    nuisances = np.array([z for z, _ in points])
    white, key = arena.residuals(values, nuisances), arena.keys(values, nuisances)
    return [
        _score(arena, fit, groups, names, points[rows], precisions[rows], white[rows], key[rows], solver)
        for fit, rows in ((fit, slice(i * len(names), (i + 1) * len(names))) for i, fit in enumerate(fits))
    ]


def _placed(arena: Arena, fit: Fit, by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    p = len(fit.z)
    z = np.clip(fit.z + by[:p], arena.lower, arena.upper)
    return z, np.clip(fit.x + by[p:], fit.hypothesis.stack("lower"), fit.hypothesis.stack("upper"))


def _score(
    arena: Arena, fit: Fit, groups: np.ndarray, names: np.ndarray, points: Sequence[tuple[np.ndarray, np.ndarray]],
    precisions: Sequence[np.ndarray], white: np.ndarray, key: np.ndarray, solver: Fits,
) -> Score:  # fmt: skip
    elpd, misfit = np.full(len(groups), -np.inf), np.full(len(groups), np.inf)
    for k, own in enumerate(arena.white):
        g = int(np.searchsorted(names, groups[k]))
        squares = np.zeros(len(own.kinds))
        logdet = own.logdet.copy()
        for c, kind in enumerate(own.kinds):
            r, J, without = white[g, kind.rows], fit.jacobian[kind.rows], precisions[g]
            # Woodbury: r' (1 + J P J')^-1 r, in as many numbers as there are parameters.
            inner = without + J.T @ J
            along = J.T @ r
            squares[c] = max(float(r @ r - along @ np.linalg.pinv(inner, hermitian=True) @ along), 0.0)
            logdet[c] += float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(without)[1])
        elpd[k] = -float(minus_log(squares, logdet, np.array(own.size)))
        misfit[k] = squares[0] / own.size
    place = {(one.run, one.interval): int(np.searchsorted(names, groups[k])) for k, one in enumerate(arena.many)}
    ends = np.array([key[place[one.run, one.interval], k] for k, one in enumerate(arena.whole)])
    ends[np.abs(ends).max(axis=(1, 2)) > LOST_M] = np.nan
    H, _ = solver.normal(fit)
    sd = np.sqrt(np.maximum(np.diag(np.linalg.pinv(H, hermitian=True)), 0.0))
    without = np.array([np.concatenate(point) for point in points])
    return Score(elpd, misfit, ends, sd, without)

"""How well a hypothesis predicts gaits that it was not fitted to: leave-one-gait-out log predictive density.

Without a gait the numbers are where one Gauss-Newton step leads from the whole fit; the gait is then really simulated
with them. The predictive covariance has noise, floor, starts and what the other gaits leave unsure of the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits
from r2s2r_cli.stages.diagnose.which.robust import minus_log, weight

LOST_M = 0.25
"""A cap that is simulated so far from where it was has left the finite numbers in all but name."""


@dataclass(frozen=True)
class Score:
    """elpd (stretch,): log predictive density of each stretch without its gait [nats], up to a constant that all
    hypotheses share. misfit (stretch,): squares over how many there are, 1 where noise and floor explain it. key
    (stretch, cap, 3): predicted minus observed caps at its end [m]. sd (n,): of the fitted numbers, all gaits; without
    (group, n): the numbers without each group."""

    elpd: np.ndarray
    misfit: np.ndarray
    key: np.ndarray
    sd: np.ndarray
    without: np.ndarray

    @property
    def total(self) -> float:
        """Of all stretches [nats]."""
        return float(self.elpd.sum())

    @property
    def squared(self) -> np.ndarray:
        """Mean squared 3-D distance of the caps at the end of each stretch, (stretch,) [m^2]."""
        return np.asarray(np.sum(self.key**2, axis=-1).mean(axis=-1))


def groups_of(arena: Arena) -> np.ndarray:
    """What is left out together, (stretch,): gaits; with one gait runs, with one run every interval."""
    if len(set(arena.gait.tolist())) > 1:
        return arena.gait
    runs = list(dict.fromkeys(one.run for one in arena.many))
    if len(runs) > 1:
        return np.array([runs.index(one.run) for one in arena.many])
    return np.arange(len(arena.many))


def scores(arena: Arena, fits: Sequence[Fit], groups: np.ndarray, *, held_out: bool = True) -> list[Score]:
    """Of every fit, all hypotheses and groups in one batch. held_out: False, nothing is left out (an ablation)."""
    solver = Fits(arena)
    names = np.unique(groups)
    points, precisions = [], []
    for fit in fits:
        H, gradient = solver.normal(fit)
        w = weight(arena.squares(fit.residual[None])[0], arena.sizes)
        for name in names:
            own, pull = np.zeros_like(H), np.zeros(len(H))
            for k in np.flatnonzero(groups == name) if held_out else ():
                J = fit.jacobian[arena.white[k].rows]
                own += w[k] * J.T @ J
                pull += w[k] * J.T @ fit.residual[arena.white[k].rows]
            P = np.linalg.pinv(H - own, hermitian=True)
            points.append(_placed(arena, fit, P @ (pull - gradient)))
            precisions.append(H - own)
    values = np.concatenate([
        solver.values(fits[i // len(names)].hypothesis, z[None], x[None]) for i, (z, x) in enumerate(points)
    ])  # fmt: skip
    white, key = arena.look(values, np.array([z for z, _ in points]))
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
    ends = np.full(key.shape[1:], np.nan)
    for k, own in enumerate(arena.white):
        g = int(np.searchsorted(names, groups[k]))
        r, J, without = white[g, own.rows], fit.jacobian[own.rows], precisions[g]
        ends[k] = key[g, k]
        if not np.isfinite(r).all() or np.abs(key[g, k]).max() > LOST_M:
            # The step left the robots that can be: what the derivatives say of it stands in.
            by = np.concatenate(points[g]) - np.concatenate([fit.z, fit.x])
            r, ends[k] = fit.residual[own.rows] + J @ by, np.nan
        # Woodbury: r' (1 + J P J')^-1 r, in as many numbers as there are parameters.
        inner = without + J.T @ J
        along = J.T @ r
        square = max(float(r @ r - along @ np.linalg.pinv(inner, hermitian=True) @ along), 0.0)
        spread = float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(without)[1])
        elpd[k] = -float(minus_log(np.array(square), np.array(own.size))) - 0.5 * spread - 0.5 * own.logdet
        misfit[k] = square / own.size
    H, _ = solver.normal(fit)
    sd = np.sqrt(np.maximum(np.diag(np.linalg.pinv(H, hermitian=True)), 0.0))
    without = np.array([np.concatenate(point) for point in points])
    return Score(elpd, misfit, ends, sd, without)

"""Held-out gains in the linearised problem: what an effect predicts where nothing is rough.

Contacts make the cost of a fit rough: the same fit begun elsewhere ends 20 nats off, and that is as much as many an
effect is worth. So beside the fits stands this: the response of an effect as it was simulated once, times an amplitude,
and the nuisances by their secants over a share of their prior. Amplitude and nuisances are found without a gait, and
judged on it; the refit nominal model is treated alike, so what a rough fit has missed is missed by all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits, Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.score import ENOUGH
from r2s2r_cli.stages.diagnose.which.screen import Response

AMPLITUDE_SD = 2.0
"""Of the size that the screening found best: how far the prior of an amplitude reaches from 0."""


def linear_gains(arena: Arena, base: Fit, responses: Sequence[Response], groups: np.ndarray) -> np.ndarray:
    """Held-out log density over the refit nominal model, (response,) [nats]. groups (stretch,): left out together. No
    stretch says more than ENOUGH."""
    solver = Fits(arena)
    J = base.jacobian[:, : len(base.z)]
    weights = solver.likely(base) ** 2
    group = _by_row(arena, groups)
    names = np.unique(groups)
    pull = arena.precision @ (base.z - arena.mean)
    plain = _Problem(J, base.residual, weights, group, names, arena.precision, pull)
    nominal = _costs(arena, plain, groups, names)
    found = np.zeros(len(responses))
    for k, one in enumerate(responses):
        held = solver.overruled(Hypothesis((one.candidate,)))
        own = plain if not held else _Problem(
            _without(J, held), base.residual, weights, group, names, arena.precision, pull
        )  # fmt: skip
        costs = _costs(arena, own.beside(one.change.astype(float)), groups, names)
        found[k] = float(np.clip(nominal - costs, -ENOUGH, ENOUGH).sum())
    return found


def by_element(responses: Sequence[Response], nats: np.ndarray) -> dict[str, dict[int | None, float]]:
    """The gains of responses that can be seen, by effect and number of the element (None: none, or all alike)."""
    found: dict[str, dict[int | None, float]] = {}
    for one, gain in zip(responses, nats.tolist(), strict=True):
        if one.testable:
            own = found.setdefault(one.candidate.effect, {})
            own[one.candidate.number] = max(own.get(one.candidate.number, -np.inf), gain)
    return found


class _Problem:
    """Weighted least squares from the base, with the normal matrices of every group."""

    def __init__(
        self, J: np.ndarray, residual: np.ndarray, weights: np.ndarray, group: np.ndarray, names: np.ndarray,
        precision: np.ndarray, pull: np.ndarray,
    ) -> None:  # fmt: skip
        self.J, self.residual, self.weights = J, residual, weights
        self.precision, self.pull = precision, pull
        self._rows = [np.flatnonzero(group == name) for name in names]
        self.H = np.array([(J[rows] * weights[rows, None]).T @ J[rows] for rows in self._rows])
        self.g = np.array([J[rows].T @ (weights[rows] * residual[rows]) for rows in self._rows])

    def beside(self, change: np.ndarray) -> _Problem:
        """The same with the amplitude of one more column (M,)."""
        found = object.__new__(_Problem)
        found.residual, found.weights = self.residual, self.weights
        found.J = np.concatenate([self.J, change[:, None]], axis=1)
        found._rows = self._rows
        n = self.J.shape[1]
        found.H, found.g = np.zeros((len(self.H), n + 1, n + 1)), np.zeros((len(self.H), n + 1))
        found.H[:, :n, :n], found.g[:, :n] = self.H, self.g
        for k, rows in enumerate(self._rows):
            own = self.weights[rows] * change[rows]
            found.H[k, n, :n] = found.H[k, :n, n] = self.J[rows].T @ own
            found.H[k, n, n], found.g[k, n] = own @ change[rows], own @ self.residual[rows]
        found.precision = np.zeros((n + 1, n + 1))
        found.precision[:n, :n], found.precision[n, n] = self.precision, AMPLITUDE_SD**-2.0
        found.pull = np.append(self.pull, 0.0)
        return found

    def without(self, k: int) -> np.ndarray:
        """Residuals (M,) after the step to where all groups but the k-th lead."""
        H = self.H.sum(axis=0) - self.H[k] + self.precision
        return np.asarray(self.residual - self.J @ np.linalg.solve(H, self.g.sum(axis=0) - self.g[k] + self.pull))


def _costs(arena: Arena, problem: _Problem, groups: np.ndarray, names: np.ndarray) -> np.ndarray:
    """-log density of every stretch without its group, (stretch,)."""
    after = np.array([problem.without(k) for k in range(len(names))])
    costs = minus_log(arena.squares(after), arena.logdets, arena.sizes)
    return np.asarray(costs[np.searchsorted(names, groups), np.arange(len(groups))])


def _without(J: np.ndarray, held: Sequence[int]) -> np.ndarray:
    found = J.copy()
    found[:, list(held)] = 0.0
    return found


def _by_row(arena: Arena, groups: np.ndarray) -> np.ndarray:
    """Group of every residual, (M,)."""
    count = max(kind.rows.stop for white in arena.white for kind in white.kinds)
    found = np.zeros(count, dtype=np.asarray(groups).dtype)
    for white, name in zip(arena.white, groups, strict=True):
        for kind in white.kinds:
            found[kind.rows] = name
    return found

"""An arena as a linear problem: smoothed over where the refit nominal model may be, and judged without a gait.

Contacts make what is simulated rough: a thousandth more friction, and a cap that slipped sticks. So residuals and
responses are means over a few points drawn from the posterior of the nuisances, each brought back to the base along the
secants; about that mean, nuisances and one amplitude are linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.candidates import Candidate
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits, Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.score import groups_of

POINTS = 4
"""Of the posterior, the base among them."""


class Line:
    """Weighted least squares about the refit nominal model, with the normal matrices of every group."""

    def __init__(self, arena: Arena, base: Fit, *, seed: int = 0) -> None:
        self.arena, self.solver, self.count = arena, Fits(arena), len(base.z)
        self.groups = groups_of(arena)
        self.names = np.unique(self.groups)
        self.J = base.jacobian[:, : self.count]
        self._points = self._drawn(base, np.random.default_rng(seed))
        self._at = arena.residuals(arena.values(self._points), self._points)
        self.residual = (self._at - (self._points - base.z) @ self.J.T).mean(axis=0)
        self._weights = self.solver.likely(replace(base, residual=self.residual)) ** 2
        self._pull = arena.precision @ (base.z - arena.mean)
        group = _by_row(arena, self.groups)
        self._rows = [np.flatnonzero(group == name) for name in self.names]
        J, w = self.J, self._weights
        self._H = np.array([(J[rows] * w[rows, None]).T @ J[rows] for rows in self._rows])
        self._g = np.array([J[rows].T @ (w[rows] * self.residual[rows]) for rows in self._rows])

    def changes(self, many: Sequence[tuple[Candidate, np.ndarray]]) -> np.ndarray:
        """What candidates at their sizes change in the residuals, (candidate, M), all simulated at once."""
        k = len(self._points)
        values = np.concatenate([
            self.solver.values(Hypothesis((one,)), self._points, np.repeat(size[None], k, axis=0)) for one, size in many
        ])  # fmt: skip
        there = self.arena.residuals(values, np.tile(self._points, (len(many), 1)))
        return np.asarray((there.reshape(len(many), k, -1) - self._at).mean(axis=1))

    def amplitude(self, one: Candidate, change: np.ndarray, sd: float) -> tuple[float, float]:
        """Of a change (M,), and its sd, nuisances fitted with it. sd: of its prior about 0."""
        H, g = self._beside(one, change)
        precision, pull = self._prior(sd)
        P = np.linalg.inv(H.sum(axis=0) + precision)
        return float(-(P @ (g.sum(axis=0) + pull))[-1]), float(np.sqrt(P[-1, -1]))

    def nominal(self) -> np.ndarray:
        """-log density of every piece without its group, of the refit nominal model, (piece,) [nats]."""
        return self._costs(self.J, self._H, self._g, self.arena.precision, self._pull)

    def beside(self, one: Candidate, change: np.ndarray, sd: float) -> np.ndarray:
        """The same with an amplitude of a change (M,), whose prior about 0 has this sd."""
        J = np.column_stack([self.J, change])
        J[:, self._held(one)] = 0.0
        return self._costs(J, *self._beside(one, change), *self._prior(sd))

    def _held(self, one: Candidate) -> list[int]:
        """Places of the nuisances that a candidate sets itself."""
        return self.solver.overruled(Hypothesis((one,)))

    def _prior(self, sd: float) -> tuple[np.ndarray, np.ndarray]:
        n = self.count
        precision = np.zeros((n + 1, n + 1))
        precision[:n, :n], precision[n, n] = self.arena.precision, sd**-2.0
        return precision, np.append(self._pull, 0.0)

    def _beside(self, one: Candidate, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrices (group, n + 1, n + 1) and gradients (group, n + 1) with a change, without priors."""
        n, many = self.count, len(self.names)
        H, g = np.zeros((many, n + 1, n + 1)), np.zeros((many, n + 1))
        H[:, :n, :n], g[:, :n] = self._H, self._g
        for k, rows in enumerate(self._rows):
            own = self._weights[rows] * change[rows]
            H[k, n, :n] = H[k, :n, n] = self.J[rows].T @ own
            H[k, n, n], g[k, n] = own @ change[rows], own @ self.residual[rows]
        held = self._held(one)
        H[:, held, :] = 0.0
        H[:, :, held] = 0.0
        g[:, held] = 0.0
        return H, g

    def _costs(
        self, J: np.ndarray, H: np.ndarray, g: np.ndarray, precision: np.ndarray, pull: np.ndarray
    ) -> np.ndarray:  # fmt: skip
        """-log density of every piece where all groups but its own lead, (piece,)."""
        arena = self.arena
        after = np.array([
            self.residual - J @ np.linalg.solve(H.sum(axis=0) - H[k] + precision, g.sum(axis=0) - g[k] + pull)
            for k in range(len(H))
        ])  # fmt: skip
        costs = minus_log(arena.squares(after), arena.logdets, arena.sizes)
        return np.asarray(costs[np.searchsorted(self.names, self.groups), np.arange(len(self.groups))])

    def _drawn(self, base: Fit, rng: np.random.Generator) -> np.ndarray:
        """The base and POINTS - 1 others of its posterior, (POINTS, n)."""
        value, vector = np.linalg.eigh(np.linalg.pinv(self.solver.normal(base)[0], hermitian=True))
        root = vector * np.sqrt(np.maximum(value, 0.0))
        drawn = base.z + rng.standard_normal((POINTS - 1, len(base.z))) @ root.T
        return np.clip(np.concatenate([base.z[None], drawn]), self.arena.lower, self.arena.upper)


def _by_row(arena: Arena, groups: np.ndarray) -> np.ndarray:
    """Group of every residual, (M,)."""
    found = np.zeros(max(kind.rows.stop for white in arena.white for kind in white.kinds), dtype=groups.dtype)
    for white, name in zip(arena.white, groups, strict=True):
        for kind in white.kinds:
            found[kind.rows] = name
    return found

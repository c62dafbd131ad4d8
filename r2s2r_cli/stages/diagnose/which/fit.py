"""Hypotheses fitted together: nuisances and the numbers of an effect, all from the same start with the same budget.

Derivatives by the nuisances are exact at the nominal point; those by an effect are secants where the fit is, because
many effects have no derivative where they are off. Both follow the fit by Broyden's rank-one update.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import minus_log, weight
from r2s2r_cli.stages.diagnose.which.prior import unlikely
from r2s2r_cli.stages.diagnose.which.white import whitened

ITERATIONS = 6
LENGTHS = (1.0, 0.3)
"""Shares of a step that are tried together."""
SECANT = 0.25
"""Of a number's scale: length of a secant."""
LEAST_GAIN = 0.3
"""[nats] A fit that gains less in a step has ended."""
NO_WEIGHT = 1e-9
"""A kind of error that is less likely for a stretch adds nothing to its normal matrix."""
PRIOR_SCALES = 2.0
"""Prior sd of an effect's number, in its scale."""


class Fits:
    """All fits of one arena, moved on together."""

    def __init__(self, arena: Arena) -> None:
        self.arena = arena

    def cost(self, hypothesis: Hypothesis, z: np.ndarray, x: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Robust cost with priors, (k,), at z (k, p + q), x (k, n), residuals (k, M); inf where not finite."""
        prior = unlikely(self.arena, z)
        if x.shape[1]:
            sd = PRIOR_SCALES * hypothesis.stack("scale")
            prior = prior + 0.5 * np.sum(((x - hypothesis.stack("off")) / sd) ** 2, axis=1)
        data = self.nats(residual).sum(axis=1)
        return np.where(np.isfinite(data), data, np.inf) + prior

    def nats(self, residual: np.ndarray) -> np.ndarray:
        """What every stretch costs of residuals (k, M), (k, stretch)."""
        return minus_log(self.arena.squares(residual), self.arena.logdets, self.arena.sizes)

    def values(self, hypothesis: Hypothesis, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Values of the model (k, n)."""
        found = self.arena.values(z)
        for k, places in enumerate(hypothesis.spread):
            found[:, list(places)] = x[:, k : k + 1]
        return found

    def begun(
        self, points: Sequence[tuple[Hypothesis, np.ndarray, np.ndarray]], away: Sequence[np.ndarray] | None = None,
        like: Fit | None = None,
    ) -> list[Fit]:  # fmt: skip
        """Fits at points (hypothesis, z, x), whose stretches begin `away` (`Fit.away`), as the arena says if None.
        Derivatives are those of the fit `like`, which is of no effect, or those by the nuisances alone."""
        if not points:
            return []
        own = [self.arena.away] * len(points) if away is None else list(away)
        raw = self._raw(points, own)
        white = whitened(self.arena.white, raw)
        found = []
        for i, (h, z, x) in enumerate(points):
            cost = float(self.cost(h, z[None], x[None], white[i : i + 1])[0])
            J = self._derivatives(h, len(x)) if like is None else like.jacobian
            found.append(Fit(h, z.copy(), x.copy(), white[i], J, cost, x.copy(), own[i].copy(), [r[i] for r in raw]))
        return found

    def _derivatives(self, hypothesis: Hypothesis, count: int) -> np.ndarray:
        found = np.pad(self.arena.by_nuisance, ((0, 0), (0, count)))
        found[:, self.overruled(hypothesis)] = 0.0
        return found

    def costs(
        self, points: Sequence[tuple[Hypothesis, np.ndarray, np.ndarray]], away: Sequence[np.ndarray]
    ) -> np.ndarray:  # fmt: skip
        """At points as of `begun`, (point,)."""
        white = whitened(self.arena.white, self._raw(points, away))
        return np.array([
            self.cost(h, z[None], x[None], white[i : i + 1])[0] for i, (h, z, x) in enumerate(points)
        ])  # fmt: skip

    def overruled(self, hypothesis: Hypothesis) -> list[int]:
        """Places in z of nuisances that are the hypothesis's own numbers: it sets them, whatever z says."""
        own = {place for places in hypothesis.spread for place in places}
        return [k for k, place in enumerate(self.arena.engine) if place in own]

    def run(
        self, fits: Sequence[Fit], *, iterations: int = ITERATIONS, told: Callable[[int, int], None] | None = None
    ) -> None:
        """Move all fits on until they gain nothing any more. All get the same number of iterations."""
        self.secants(fits)
        for iteration in range(iterations):
            going = [fit for fit in fits if not fit.ended]
            if not going:
                break
            steps = [self.step(fit) for fit in going]
            points = []
            for fit, step in zip(going, steps, strict=True):
                for length in LENGTHS:
                    points.append(self.moved(fit, length * step))
            raw = self._raw(
                [(going[i // len(LENGTHS)].hypothesis, *point) for i, point in enumerate(points)],
                [fit.away for fit in going for _ in LENGTHS],
            )
            for i, fit in enumerate(going):
                rows = slice(i * len(LENGTHS), (i + 1) * len(LENGTHS))
                self._take(fit, points[rows], [one[rows] for one in raw])
            self.settle(going)
            if told is not None:
                told(iteration + 1, iterations)

    def settle(self, fits: Sequence[Fit]) -> None:
        """Lets the stretches of all fits begin where they most likely did, those that are better for it."""
        if not fits:
            return
        before = [np.array(rows) for rows in zip(*(fit.raw for fit in fits), strict=True)]
        wanted = list(self.arena.likely_starts(before))
        raw = self._raw([(fit.hypothesis, fit.z, fit.x) for fit in fits], wanted)
        white = whitened(self.arena.white, raw)
        own = np.array([fit.residual for fit in fits])
        costs = self.nats(own)
        better = self.nats(white) < costs
        mixed = [np.where(yes[:, None], new, old) for yes, new, old in zip(better.T, raw, before, strict=True)]
        white = whitened(self.arena.white, mixed)
        gains = (costs - self.nats(white)).sum(axis=1)
        for i, (fit, gain) in enumerate(zip(fits, gains.tolist(), strict=True)):
            if gain <= 0:
                continue
            fit.residual, fit.raw = white[i], [one[i] for one in mixed]
            fit.away = np.where(better[i][:, None], wanted[i], fit.away)
            fit.cost -= gain
            fit.ended = fit.ended and gain < LEAST_GAIN

    def step(self, fit: Fit) -> np.ndarray:
        """The damped step (p + q + k,)."""
        H, g = self.normal(fit)
        scale = np.sqrt(np.maximum(np.diag(H), 1e-12))
        A = H / np.outer(scale, scale) + fit.damping * np.eye(len(H))
        return np.asarray(-np.linalg.solve(A, g / scale) / scale)

    def normal(
        self, fit: Fit, products: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Re-weighted normal matrix and gradient, with priors. products: of the fit, where they are known already."""
        H, g = (part.sum(axis=0) for part in products or self.products(fit))
        p = len(fit.z)
        H[:p, :p] += self.arena.precision
        g[:p] += self.arena.precision @ (fit.z - self.arena.mean)
        if len(fit.x):
            sd = PRIOR_SCALES * fit.hypothesis.stack("scale")
            H[p:, p:] += np.diag(sd**-2.0)
            g[p:] += (fit.x - fit.hypothesis.stack("off")) / sd**2
        return H, g

    def likely(self, fit: Fit) -> np.ndarray:
        """Square roots of the weights of all its residuals, (M,): of what fell, nothing can be told."""
        w = self.weights(fit)
        found = np.zeros(len(fit.residual))
        for white, own in zip(self.arena.white, w, strict=True):
            for kind, one in zip(white.kinds, own, strict=True):
                found[kind.rows] = np.sqrt(one)
        return found

    def products(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        """What every stretch adds to the normal matrix, (stretch, n, n), and to the gradient, (stretch, n)."""
        w = self.weights(fit)
        n = fit.jacobian.shape[1]
        H, g = np.zeros((len(w), n, n)), np.zeros((len(w), n))
        for k, white in enumerate(self.arena.white):
            for c, kind in enumerate(white.kinds):
                if w[k, c] < NO_WEIGHT:
                    continue
                J = fit.jacobian[kind.rows]
                H[k] += w[k, c] * J.T @ J
                g[k] += w[k, c] * J.T @ fit.residual[kind.rows]
        return H, g

    def weights(self, fit: Fit) -> np.ndarray:
        """Of each kind of error, (stretch, kind)."""
        return weight(self.arena.squares(fit.residual[None])[0], self.arena.logdets, self.arena.sizes)

    def moved(self, fit: Fit, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nuisances and the effect's numbers after a step (p + q + k,), within bounds."""
        p = len(fit.z)
        z = np.clip(fit.z + step[:p], self.arena.lower, self.arena.upper)
        x = np.clip(fit.x + step[p:], fit.hypothesis.stack("lower"), fit.hypothesis.stack("upper"))
        return z, x

    def _raw(
        self, points: Sequence[tuple[Hypothesis, np.ndarray, np.ndarray]], away: Sequence[np.ndarray]
    ) -> list[np.ndarray]:  # fmt: skip
        values = np.concatenate([self.values(h, z[None], x[None]) for h, z, x in points])
        return self.arena.raw(values, np.array([z for _, z, _ in points]), away=np.array(away))

    def _take(
        self, fit: Fit, points: Sequence[tuple[np.ndarray, np.ndarray]], raw: Sequence[np.ndarray]
    ) -> None:  # fmt: skip
        """Go to the best point, if it is better, and mend the derivatives by what was seen."""
        residuals = whitened(self.arena.white, raw)
        z, x = np.array([point[0] for point in points]), np.array([point[1] for point in points])
        costs = self.cost(fit.hypothesis, z, x, residuals)
        best = int(np.argmin(costs))
        gain = fit.cost - float(costs[best])
        if not gain > 0:
            fit.damping *= 100.0
            fit.ended = fit.damping > 10.0
            return
        by = np.concatenate([z[best] - fit.z, x[best] - fit.x])
        scale = np.concatenate([1.0 / np.sqrt(np.diag(self.arena.precision)), fit.hypothesis.stack("scale")])
        unit = by / scale
        if unit @ unit > 0:
            missing = residuals[best] - fit.residual - fit.jacobian @ by
            fit.jacobian = fit.jacobian + np.outer(missing, unit / scale / (unit @ unit))
        fit.z, fit.x, fit.residual, fit.cost = z[best], x[best], residuals[best], float(costs[best])
        fit.raw = [one[best] for one in raw]
        fit.damping = max(1e-6, fit.damping / 3.0 if best == 0 else fit.damping * 3.0)
        fit.ended = gain < LEAST_GAIN

    def secants(self, fits: Sequence[Fit]) -> None:
        """Derivatives by the effects' numbers where the fits are: secants away from the nearer bound."""
        points, where = [], []
        for fit in fits:
            scale = SECANT * fit.hypothesis.stack("scale")
            room = fit.hypothesis.stack("upper") - fit.x
            by = np.where(room > scale, scale, -scale)
            for i in range(len(fit.x)):
                x = fit.x.copy()
                x[i] += by[i]
                points.append((fit.hypothesis, fit.z, x))
                where.append((fit, i, by[i]))
        if not points:
            return
        residuals = whitened(self.arena.white, self._raw(points, [fit.away for fit, _, _ in where]))
        for (fit, i, by), residual in zip(where, residuals, strict=True):
            column = (residual - fit.residual) / by
            fit.jacobian[:, len(fit.z) + i] = np.where(np.isfinite(column), column, 0.0)

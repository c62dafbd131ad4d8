"""The cost of a closed loop as it is on the scale of what the data can tell: a plane through simulations about a point.

A controller decides tick by tick, a cap sticks or slips: residuals jump where a parameter moves by a fraction of its
standard deviation. A derivative says how steep one facet is, and a fit that takes it for the slope stops on a facet and
is sure of it. So residuals are sampled about the point, as far as the parameters are uncertain, in pairs on either side
of it. Through them goes a plane by least squares, which is what the parameters do to the residuals; what is left of the
samples, facet by facet, is noise of the model, which the real run has its own draw of, and is added to that of the
observation (Gauss-Newton with slopes by regression, as ensemble smoothers have: Evensen 2018).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.closed_residuals import ClosedResiduals
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import Loss
from r2s2r_cli.stages.identify.solve.problem import Evaluation, still_of
from r2s2r_cli.stages.identify.solve.record import Counts, Progress, Reason, Solution
from r2s2r_cli.stages.identify.trust.information import marginal

PAIRS, LEAST_PAIRS = 4, 24
"""Of samples for each parameter, and in all: the plane has one slope for each, the rest shows what it leaves."""
TOGETHER, EACH = 1.0, 1.0
"""Variances of what the plane leaves, as shares of what the samples show: of all residuals together as they move there,
a tick that moves every cap of a key frame; and of each by itself, since samples do not show all ways they can move."""
REACH = 3.0
"""How far samples lie from the point, in posterior standard deviations (sd of each parameter). With 1.5 four of 21
planted numbers lay outside their intervals, with 3 none: jumps that lie further apart than the samples are not seen."""
ROUNDS = 5
"""Planes at most, each about the minimum of the one before."""
TRUSTED, STILL = 3.0, 0.5
"""Furthest step, in spreads of the samples; and a step that is none, in posterior standard deviations."""
WIDEST = 0.3
"""Of the samples, in widths of the priors: far out the residuals are no plane."""


class Surface:
    """A `Problem` like the one it stands for: the plane through samples about z, in its unknowns, and behind them one
    of unit prior for what the plane leaves of each pair of samples.

    rough: sd of what the plane leaves of each residual, in units of the sd it had, (m,). Evaluations cost nothing.
    """

    def __init__(self, problem: ClosedResiduals, z: np.ndarray, spread: np.ndarray, seed: int) -> None:
        """spread: covariance of the samples about the parameters of z, (p, p). Raises NumericalError where too few
        samples are finite."""
        p = len(problem.frees)
        draw = np.random.default_rng(seed)
        root = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread)))
        by = _unit(draw, max(PAIRS * p, LEAST_PAIRS), p) @ root.T
        centre = z[:p]
        low, high = problem.lower[:p], problem.upper[:p]
        # Both sides of a pair are as far from the point, so what is even in the distance drops out of the slopes.
        room = np.minimum(high - centre, centre - low)
        by = np.clip(by, -room, room)
        by[:, still_of(problem)] = 0.0
        samples = problem.batch(np.vstack([centre[None], centre + by, centre - by]))
        up, down = samples[1 : len(by) + 1], samples[len(by) + 1 :]
        good = np.isfinite(up).all(axis=1) & np.isfinite(down).all(axis=1)
        if good.sum() <= p or not np.isfinite(samples[0]).all():
            raise NumericalError(
                "the closed loop cannot be simulated about the fit", where="--drive closed-loop",
                expected=f"more than {p} finite pairs of simulations", received=str(int(good.sum())),
                hint="narrow its bounds: --free NAME=START,LOWER..UPPER",
            )  # fmt: skip
        by, up, down = by[good], up[good], down[good]
        odd = 0.5 * (up - down)
        slope = np.linalg.lstsq(by, odd, rcond=None)[0]
        left = (odd - by @ slope) * np.sqrt(2.0 / (len(by) - p))
        self.rough = np.sqrt((left**2).sum(axis=0))
        scale = 1.0 / np.sqrt(1.0 + EACH * self.rough**2)
        self.problem, self.frees, self.names = problem, problem.frees, problem.names
        wide, none = np.full(len(left), np.inf), np.zeros(len(left))
        self.lower, self.upper = np.concatenate([problem.lower, -wide]), np.concatenate([problem.upper, wide])
        self.prior_mean = np.concatenate([problem.prior_mean, none])
        self.prior_sd = np.concatenate([problem.prior_sd, none + 1.0])
        self.z0 = np.concatenate([problem.z0, none])
        self.block, self.cluster, self.held = problem.block, problem.cluster, problem.held
        self.predictor, self.windows, self.split = problem.predictor, problem.windows, problem.split
        self.centre = centre
        self._at = np.vstack([samples[:1], 0.5 * (up + down)]).mean(axis=0) * scale
        self._slope = np.hstack([slope.T, problem.by_others, np.sqrt(TOGETHER) * left.T]) * scale[:, None]

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Of the plane."""
        p = len(self.centre)
        residual = self._at + self._slope @ np.concatenate([z[:p] - self.centre, z[p:]])
        return Evaluation(residual, self._slope.copy() if jacobian else None, self.block)


def planes(
    problem: ClosedResiduals, z: np.ndarray, spread: np.ndarray, loss: Loss, seed: int,
    progress: Callable[[Progress], None] | None = None,
) -> tuple[Surface, Solution]:  # fmt: skip
    """The minimum of the cost on the scale of its own uncertainty, from parameters z (p,) near it.

    spread: covariance (p, p) of the first samples. A plane is believed as far as its samples lie, so its minimum may
    lie `TRUSTED` times as far; the last plane is about a minimum that the one before left by less than `STILL`.
    Raises NumericalError.
    """
    p = len(problem.frees)
    surface: Surface | None = None
    costs: list[float] = []
    solution: Solution | None = None
    still = False
    for number in range(ROUNDS):
        surface = Surface(problem, z, REACH**2 * spread, seed + 100 * number)
        start = np.concatenate([z, surface.z0[p:]])
        solution = levenberg_marquardt(surface, start, loss=loss, max_iterations=30, tolerance=1e-8)
        costs.append(solution.cost)
        step = solution.z[:p] - z
        far = float(np.sqrt(step @ np.linalg.solve(REACH**2 * spread, step)))
        if progress is not None:
            progress(Progress(number + 1, ROUNDS, solution.cost, 0.0, far, Counts(plain=problem.predictor.rollouts)))
        if still:
            break
        spread = posterior(solution, problem)
        here = np.clip(z + min(1.0, TRUSTED / max(far, 1e-12)) * step, problem.lower[:p], problem.upper[:p])
        still = float(np.sqrt(step @ np.linalg.solve(spread, step))) < STILL
        z = here
    assert surface is not None and solution is not None  # noqa: S101 - there is a round
    reason = Reason.STEP if still else Reason.ITERATIONS
    return surface, replace(solution, costs=tuple(costs), iterations=len(costs), reason=reason)


def posterior(solution: Solution, problem: ClosedResiduals) -> np.ndarray:
    """Covariance of the parameters by the curvature of the cost, (p, p), no wider than samples may lie."""
    curvature = marginal(solution.normal, len(problem.frees))
    curvature = curvature + np.diag((WIDEST * problem.widths) ** -2.0)
    found = np.linalg.inv(curvature)
    return np.asarray(0.5 * (found + found.T))


def _unit(draw: np.random.Generator, count: int, p: int) -> np.ndarray:
    """Normal draws (count, p) that are uncorrelated and of unit variance as they stand, where there are enough."""
    drawn = draw.standard_normal((count, p))
    if count <= p:
        return drawn
    q, _ = np.linalg.qr(drawn)
    return np.asarray(q * np.sqrt(count))

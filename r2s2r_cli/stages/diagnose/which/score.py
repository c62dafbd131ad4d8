"""How well a hypothesis predicts gaits that it was not fitted to: leave-one-gait-out log predictive density.

Without a gait the numbers are where one Gauss-Newton step leads from the whole fit; the gait is then really simulated
with them. The step makes up for what the gait had pulled, and for what the nuisances still had before them; an
effect's numbers stand where the fit could not make them better, on the edge of a cliff it may be, and no step is owed
to them. The predictive covariance has noise, floor, starts and what the other gaits leave unsure of the numbers. It
is simulated at a few points close together (`rough`), and a piece's log density is the mean of theirs. A number of an
effect that the data say nothing of near its fit stays where it is: its prior alone would lead it back to off, over
the cliff that it came by (motors that never turn do not tell how far beyond their drive the dead zone goes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH, bounded, gains_over_first
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.rough import DRAWS, around, root_of
from r2s2r_cli.stages.diagnose.which.starting import LOST_M
from r2s2r_cli.stages.diagnose.which.white import White

SILENT = 0.01
"""Of the precision of a number's prior, below which data say nothing of it."""


@dataclass(frozen=True)
class Score:
    """elpd (stretch,): log predictive density of each stretch without its gait [nats], up to a constant that all
    hypotheses share. misfit (stretch,): squares over how many there are, 1 where noise and floor explain it. ends
    (interval, cap, 3): predicted minus observed caps at its end [m], NaN where nothing could be simulated. sd (n,): of
    the fitted numbers, all gaits: what noise leaves unsure, and how far apart simulations close together want them;
    without (group, n): the numbers without each group."""

    elpd: np.ndarray
    misfit: np.ndarray
    ends: np.ndarray
    sd: np.ndarray
    without: np.ndarray

    @property
    def key(self) -> np.ndarray:
        """As `ends`, NaN in the whole of an interval at the end of which a cap is lost: there is nothing to be learned
        from where a fall led to."""
        lost = ~(np.abs(self.ends).max(axis=(1, 2)) <= LOST_M)
        return np.where(lost[:, None, None], np.nan, self.ends)

    @property
    def squared(self) -> np.ndarray:
        """Mean squared 3-D distance of the caps at the end of each interval, (interval,) [m^2]. A lost cap counts
        LOST_M, wherever it is, and so does one that could not be simulated: left out of a mean, an effect that is off
        by 30 cm would look better than one that is off by 14 cm."""
        square = np.sum(self.ends**2, axis=-1)
        return np.asarray(np.minimum(np.where(np.isfinite(square), square, np.inf), LOST_M**2).mean(axis=-1))


def gains(refit: Score, others: Sequence[Score], enough: float = ENOUGH) -> np.ndarray:
    """Held-out log density of hypotheses over the refit nominal model, (hypothesis,) [nats]. At a piece none loses more
    than `enough` against the best of them all (`bounded`)."""
    return gains_over_first(_table(refit, others), enough)


def gain_sds(refit: Score, others: Sequence[Score], groups: np.ndarray) -> np.ndarray:
    """Sd of the gains, (hypothesis,) [nats], from how much the groups differ in what they gain; nan with one group."""
    table = bounded(_table(refit, others))
    own = np.stack([(table[1:] - table[0])[:, groups == name].sum(axis=1) for name in np.unique(groups)], axis=1)
    count = own.shape[1]
    return np.sqrt(count) * own.std(axis=1, ddof=1) if count > 1 else np.full(len(own), np.nan)


def _table(refit: Score, others: Sequence[Score]) -> np.ndarray:
    """Log densities (1 + hypothesis, stretch), the refit nominal model first."""
    return np.array([refit.elpd, *(score.elpd for score in others)])


def groups_of(arena: Arena) -> np.ndarray:
    """What is left out together, (stretch,): gaits; with one gait runs, with one run every interval."""
    if len(set(arena.gait.tolist())) > 1:
        return arena.gait
    runs = list(dict.fromkeys(one.run for one in arena.many))
    if len(runs) > 1:
        return np.array([runs.index(one.run) for one in arena.many])
    places = list(dict.fromkeys((one.run, one.interval) for one in arena.many))
    return np.array([places.index((one.run, one.interval)) for one in arena.many])


@dataclass(frozen=True)
class _Left:
    """The numbers of a fit without a group: points (draw, n), their precision (n, n)."""

    points: np.ndarray
    precision: np.ndarray

    @property
    def away(self) -> np.ndarray:
        """From the first point, (draw, n)."""
        return np.asarray(self.points - self.points[0])


def scores(arena: Arena, fits: Sequence[Fit], groups: np.ndarray, *, held_out: bool = True) -> list[Score]:
    """Of every fit; all hypotheses in one batch for each group. held_out: False, nothing is left out."""
    solver = Fits(arena)
    names = np.unique(groups)
    place = {(one.run, one.interval): groups[k] for k, one in enumerate(arena.many)}
    of_whole = np.array([place[one.run, one.interval] for one in arena.whole])
    products = [solver.products(fit) for fit in fits]
    normals = [(*own, *solver.normal(fit, own)) for fit, own in zip(fits, products, strict=True)]
    n, caps = len(fits), arena.whole[0].caps.shape[1]
    elpd, misfit = np.full((n, len(groups)), -np.inf), np.full((n, len(groups)), np.inf)
    reached = np.full((n, len(of_whole), caps, 3), np.nan)
    without: list[list[np.ndarray]] = [[] for _ in fits]
    away = np.repeat(np.array([fit.away for fit in fits]), DRAWS, axis=0)
    weights = [solver.weights(fit) for fit in fits]
    pulls = [np.zeros((DRAWS, len(H))) for _, _, H, _ in normals]
    for name in names:
        own, ends = np.flatnonzero(groups == name), np.flatnonzero(of_whole == name)
        out = own if held_out else own[:0]
        left = [
            _without(
                arena, fit, H - by[out].sum(axis=0), pull[out].sum(axis=0) - _owed(fit, gradient), _silent(fit, by)
            )
            for fit, (by, pull, H, gradient) in zip(fits, normals, strict=True)
        ]
        values, z = _at(solver, fits, [one.points for one in left])
        white = arena.settled(values, z, own.tolist(), away).reshape(n, DRAWS, -1)
        first = slice(None, None, DRAWS)
        if len(ends):  # where the robot tips over as an interval begins, there is no key frame
            reached[:, ends] = arena.keys(values[first], z[first], ends.tolist())
        for i, (fit, one) in enumerate(zip(fits, left, strict=True)):
            without[i].append(one.points[0])
            for k in own:
                elpd[i, k], misfit[i, k], pull = _piece(arena.white[k], fit.jacobian, white[i], one, weights[i][k])
                pulls[i] += pull
    sds = [_sd(H, pull) for (_, _, H, _), pull in zip(normals, pulls, strict=True)]
    return [Score(elpd[i], misfit[i], reached[i], sds[i], np.array(without[i])) for i in range(n)]


def _sd(H: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    """Of numbers with the normal matrix H: what noise leaves unsure, and how far apart the points would have them. Were
    the cost smooth, all pulls (draw, n) would be the same."""
    covariance = np.linalg.pinv(H, hermitian=True)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0) + (pulls @ covariance).var(axis=0, ddof=1))


def _owed(fit: Fit, gradient: np.ndarray) -> np.ndarray:
    """Of the gradient of a fit what it has not followed yet: that by the nuisances."""
    return np.asarray(np.where(np.arange(len(gradient)) < len(fit.z), gradient, 0.0))


def _silent(fit: Fit, by: np.ndarray) -> np.ndarray:
    """Places of an effect's numbers, behind the nuisances, of which the pieces say nothing. by (piece, n, n): what each
    adds to the normal matrix."""
    prior = (PRIOR_SCALES * fit.hypothesis.stack("scale")) ** -2.0
    told = np.diag(by.sum(axis=0))[len(fit.z) :]
    return np.asarray(len(fit.z) + np.flatnonzero(told < SILENT * prior))


def _without(arena: Arena, fit: Fit, precision: np.ndarray, pull: np.ndarray, silent: np.ndarray) -> _Left:
    """The step to the numbers without a group, and points about where it leads. silent: numbers that stay."""
    root = root_of(precision)
    root[silent] = 0.0
    middle = np.concatenate([fit.z, fit.x]) + root @ (root.T @ pull)
    low = np.concatenate([arena.lower, fit.hypothesis.stack("lower")])
    high = np.concatenate([arena.upper, fit.hypothesis.stack("upper")])
    return _Left(around(middle, root, low, high), precision)


def _at(solver: Fits, fits: Sequence[Fit], points: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Values of the model and nuisances of all points of all fits, one fit after the other."""
    z = [own[:, : len(fit.z)] for fit, own in zip(fits, points, strict=True)]
    x = [own[:, len(fit.z) :] for fit, own in zip(fits, points, strict=True)]
    values = [solver.values(fit.hypothesis, *both) for fit, *both in zip(fits, z, x, strict=True)]
    return np.concatenate(values), np.concatenate(z)


def _piece(
    white: White, jacobian: np.ndarray, residual: np.ndarray, left: _Left, weights: np.ndarray
) -> tuple[float, float, np.ndarray]:  # fmt: skip
    """Log predictive density of a piece, its misfit, and gradients (draw, n) of its cost at the points, each brought
    back to the first along the derivatives. jacobian (M, n); residual (draw, M); weights (kind,): of the fit."""
    squares, logdet = np.zeros((len(residual), len(white.kinds))), white.logdet.copy()
    pull = np.zeros((len(residual), jacobian.shape[1]))
    for c, kind in enumerate(white.kinds):
        J = jacobian[kind.rows]
        r = residual[:, kind.rows] - left.away @ J.T
        # Woodbury: r' (1 + J P J')^-1 r, in as many numbers as there are parameters.
        inner = left.precision + J.T @ J
        along = r @ J
        pull += weights[c] * along
        explained = np.sum((along @ np.linalg.pinv(inner, hermitian=True)) * along, axis=1)
        squares[:, c] = np.maximum(np.sum(r**2, axis=1) - explained, 0.0)
        logdet[c] += float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(left.precision)[1])
    costs = minus_log(squares, logdet, np.array(white.size))
    return -float(costs.mean()), float(np.median(squares[:, 0])) / white.size, pull

"""What the refined simulator leaves behind and the robot repeats: a discrepancy by transition, shrunk by the evidence.

No physics: a statistical term beside it (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425), as a random effect of
each transition from one target vector to the next. The simulator is off by G beyond what the robot scatters anyway; the
mean of n repeats is off by floor / sqrt(n). So the repeats count n G^2 / (n G^2 + floor^2), and nothing where the
simulator is as good as the robot's own repeats, or where the transition was never seen. All from training intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.judged import Replayed
from r2s2r_cli.stages.measures.align import PlanarMove, planar
from r2s2r_cli.stages.measures.baselines import carry
from r2s2r_cli.stages.measures.floor import Floor, floor_of
from r2s2r_cli.stages.measures.keyframes import keyframe_errors
from r2s2r_cli.stages.measures.replay import carried
from r2s2r_cli.stages.measures.steps import Step, chains, repeats_of, support
from r2s2r_cli.stages.measures.table import Predicted

QUANTILES = 48
"""Of each variance's posterior that the weight is averaged over."""


@dataclass(frozen=True)
class LeftOut:
    """Training intervals predicted with the repeats of the others, key-frame cap RMSE [m]: the simulator alone, and
    with what repeats. intervals: how many of them have repeats."""

    alone_m: float
    with_m: float
    intervals: int


@dataclass(frozen=True)
class Repeating:
    """What training intervals say. steps: they, with smoothed caps. mse: of the simulator at their key frames [m^2];
    intervals: how many stand behind it; floor: how far the robot repeats itself among them. dof: independent squares in
    the error of one interval. unlike: mean square by which starts of repeats differ in shape [m^2]."""

    steps: tuple[Step, ...]
    mse: float
    intervals: int
    floor: Floor
    dof: float
    unlike: float

    @property
    def gap_m(self) -> float:
        """What the simulator is off beyond the floor, sqrt(max(0, mse - floor^2)) [m]."""
        return float(np.sqrt(max(0.0, self.mse - self.floor.floor_m**2)))

    def weight(self, unlike: Sequence[float] = (0.0,)) -> tuple[float, np.ndarray]:
        """How much repeats count beside the simulator, 0 to 1, and the share of each (k,).

        unlike: mean square by which each one's start differs from the start that is predicted from [m^2]; what goes
        beyond the usual adds to its variance; none: weight 0. Both variances are known from few intervals: the weight
        is its mean over their posteriors, scaled inverse chi-square (Jeffreys prior).
        """
        from scipy.stats import chi2

        if not len(unlike):
            return 0.0, np.zeros(0)
        excess = np.maximum(0.0, np.asarray(unlike, dtype=float) - self.unlike)
        levels = 1.0 - (np.arange(QUANTILES) + 0.5) / QUANTILES

        def drawn(variance: float, dof: float) -> np.ndarray:
            return np.asarray(dof * variance / chi2.ppf(levels, dof))

        own = drawn(self.floor.floor_m**2, self.dof * self.floor.contrasts)[:, None]
        signal = np.maximum(0.0, drawn(self.mse, self.dof * self.intervals)[None, :] - own)
        precision = np.sum([1.0 / (own + more) for more in excess], axis=0)
        share = 1.0 / (self.floor.floor_m**2 + excess)
        return float(np.mean(signal * precision / (signal * precision + 1.0))), share / share.sum()

    def without(self, step: Step) -> Repeating:
        """The same, but `step` is nobody's repeat."""
        left = tuple(one for one in self.steps if (one.run, one.interval) != (step.run, step.interval))
        return Repeating(left, self.mse, self.intervals, self.floor, self.dof, self.unlike)


@dataclass(frozen=True)
class WithRepeats:
    """A prediction with what repeats. path: (frame, cap, 3) [m] of each chain in free run. weights, repeats: of each
    step at its key frame, (step,)."""

    predicted: Predicted
    weights: np.ndarray
    repeats: np.ndarray


@dataclass(frozen=True)
class Repeats:
    """The model, its evidence, and the test intervals with it; None: no training interval has a repeat, or nothing was
    held out."""

    model: Repeating
    evidence: LeftOut | None
    made: WithRepeats | None

    @property
    def used(self) -> bool:
        """Whether training intervals are predicted better with it than without: test intervals then are as well."""
        return self.evidence is not None and self.evidence.with_m < self.evidence.alone_m


def repeats_from(train: Replayed, smoothed: Sequence[Step], test: Replayed) -> Repeats | None:
    """What training intervals say, and test intervals with it. None as `learned`."""
    model = learned(train, smoothed)
    if model is None:
        return None
    return Repeats(model, left_out(model, train), with_repeats(model, test) if test.steps else None)


def learned(train: Replayed, smoothed: Sequence[Step]) -> Repeating | None:
    """From training intervals replayed, each from its own start, and the same with smoothed caps. None where no
    transition was seen twice: nothing tells then what repeats from what does not."""
    floor = floor_of(train.steps)
    usable = [k for k, step in enumerate(train.steps) if step.phase is not None and not step.faulty]
    if floor is None or floor.floor_m == 0.0:
        return None
    errors = np.array([train.simulated[k][-1] - train.steps[k].key for k in usable])
    pairs = [(step, other) for step in smoothed for other in repeats_of(step, smoothed)]
    return Repeating(
        steps=tuple(smoothed),
        mse=float(np.mean(np.sum(errors**2, axis=-1))),
        intervals=len(usable),
        floor=floor,
        dof=independent(errors.reshape(len(errors), -1)),
        unlike=float(np.mean([carry(other, step.start).start_rmse_m ** 2 for step, other in pairs])) if pairs else 0.0,
    )


def independent(errors: np.ndarray) -> float:
    """Effective number of independent squares in the squared length of a row of errors (row, n).

    (tr C)^2 / tr(C^2) (Satterthwaite), both from pairs of different rows, so that few rows do not bias it; 1 to n.
    """
    products = errors @ errors.T
    other = ~np.eye(len(errors), dtype=bool)
    square = np.diag(products)
    both = float(np.sum(products[other] ** 2))
    found = float(np.outer(square, square)[other].sum()) / both if both > 0 else float(errors.shape[1])
    return float(np.clip(found, 1.0, errors.shape[1]))


def with_repeats(model: Repeating, made: Replayed) -> WithRepeats:
    """Steps and free runs of `made` with what repeats. Nothing of a step is used but its start and its targets."""
    keys, weights, counts = [], [], []
    for step, path in zip(made.steps, made.simulated, strict=True):
        found = [carry(one, path[0]) for one in repeats_of(step, model.steps)]
        weight, share = model.weight([one.start_rmse_m**2 for one in found])
        keys.append(_blend(weight, share, path[-1], [one.key for one in found]))
        weights.append(weight)
        counts.append(len(found))
    free = tuple(_free(model, chain, path) for chain, path in zip(chains(made.steps), made.free, strict=False))
    return WithRepeats(Predicted(np.array(keys), free), np.array(weights), np.array(counts))


def left_out(model: Repeating, train: Replayed) -> LeftOut | None:
    """The evidence: each training interval with the repeats of the others. The simulator has seen all of them. None
    where none has a repeat."""
    observed, alone, both = [], [], []
    for step, path in zip(train.steps, train.simulated, strict=True):
        others = model.without(step)
        if step.faulty or not repeats_of(step, others.steps):
            continue
        observed.append(step.key)
        alone.append(path[-1])
        both.append(with_repeats(others, Replayed((step,), (path,), ())).predicted.key[0])
    if not observed:
        return None
    rmse = [keyframe_errors(np.array(observed), np.array(keys)).rmse_m for keys in (alone, both)]
    return LeftOut(float(rmse[0] or 0.0), float(rmse[1] or 0.0), len(observed))


def _blend(weight: float, share: np.ndarray, own: np.ndarray, repeats: Sequence[np.ndarray]) -> np.ndarray:
    """Simulated caps (..., cap, 3) [m] and those of the repeats."""
    if not len(repeats):
        return own
    return np.asarray((1.0 - weight) * own + weight * np.tensordot(share, np.array(repeats), axes=1))


def _free(model: Repeating, chain: Sequence[Step], path: np.ndarray) -> np.ndarray:
    """A free run (frame, cap, 3) [m]: where the prediction of one step ends, the simulated next one goes on from, moved
    over the ground, for the physics is the same in any place and heading; its shape is the simulator's own."""
    move, now, found, begin = PlanarMove(0.0, np.zeros(3)), path[0], list[np.ndarray](), 0
    for step in chain:
        end = begin + len(step.t)
        last = path[min(end, len(path) - 1)]
        like = repeats_of(step, model.steps, standing=support(now))
        weight, share = model.weight([carry(one, now).start_rmse_m ** 2 for one in like])
        parts = [carried(one, step, now) for one in like]
        found.append(_blend(weight, share, move.move(path[begin:end]), [frames for frames, _ in parts]))
        now = _blend(weight, share, move.move(last), [after for _, after in parts])
        move, begin = planar(last, now), end
    return np.concatenate(found)

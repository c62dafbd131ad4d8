"""One table of predictors over the same test steps: ours, its rivals, the baselines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.measures.baselines import LAST_CYCLE, NOTHING_MOVES, SAME_PHASE, nothing_moves, same_phase
from r2s2r_cli.stages.measures.bootstrap import Difference, Interval, bootstrap, paired
from r2s2r_cli.stages.measures.keyframes import KeyframeErrors, frame_rmse, keyframe_errors
from r2s2r_cli.stages.measures.replay import free_nothing_moves, free_same_phase
from r2s2r_cli.stages.measures.steps import Step, chains


@dataclass(frozen=True)
class Predicted:
    """What one predictor says of the test steps.

    key: end caps at the key frames (step, cap, 3) [m], each from its own start; NaN where nothing is said. free: of
    every chain (`steps.chains`) end caps at all its frames (frame, cap, 3) [m] from one start; None where nothing is
    said, empty where no free run was asked for.
    """

    key: np.ndarray
    free: tuple[np.ndarray | None, ...] = ()


@dataclass(frozen=True)
class Row:
    """One predictor, judged. free_m: mean over all frames of all chains, None where one of them is not predicted.

    free_by_step: mean over the frames of each step [m], free_frames: their number; both (step,) in the order of the
    chains. Intervals are by bootstrap over steps, None for fewer than two. In a free run a step inherits the error of
    the one before it, so that its interval is too narrow.
    """

    name: str
    key: KeyframeErrors
    key_interval: Interval | None
    free_m: float | None
    free_interval: Interval | None
    free_by_step: np.ndarray
    free_frames: np.ndarray

    def against(self, other: Row) -> Difference | None:
        """Key-frame cap RMSE of this one minus that of the other [m], over the steps that both predict."""
        return paired(self.key.mse, other.key.mse)

    def free_against(self, other: Row) -> Difference | None:
        """The same of the free run; None where one of both has none."""
        if len(self.free_by_step) != len(other.free_by_step):
            return None
        return paired(self.free_by_step, other.free_by_step, summary="mean", weights=self.free_frames)


def baselines_of(test: Sequence[Step], train: Sequence[Step]) -> dict[str, Predicted]:
    """The baselines of the design, by name: key frames and free runs."""
    runs = chains(test)
    return {
        NOTHING_MOVES: Predicted(nothing_moves(test).key, tuple(free_nothing_moves(chain) for chain in runs)),
        SAME_PHASE: Predicted(same_phase(test, train).key, tuple(free_same_phase(chain, train) for chain in runs)),
        LAST_CYCLE: Predicted(
            same_phase(test, train, last_only=True).key,
            tuple(free_same_phase(chain, train, last_only=True) for chain in runs),
        ),
    }


def judge(test: Sequence[Step], predicted: Mapping[str, Predicted], *, level: float = 0.95) -> dict[str, Row]:
    """A row for every predictor, in the order given. Raises ValueError where shapes are not those of the test steps."""
    observed = np.array([step.key for step in test])
    return {name: _row(name, test, observed, one, level) for name, one in predicted.items()}


def _row(name: str, test: Sequence[Step], observed: np.ndarray, predicted: Predicted, level: float) -> Row:
    errors = keyframe_errors(observed, predicted.key)
    by_step, frames, total = _free(test, predicted.free)
    return Row(
        name=name,
        key=errors,
        key_interval=bootstrap(errors.mse, level=level),
        free_m=total,
        free_interval=bootstrap(by_step, summary="mean", weights=frames, level=level),
        free_by_step=by_step,
        free_frames=frames,
    )


def _free(test: Sequence[Step], free: tuple[np.ndarray | None, ...]) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Mean error of each step [m], its number of frames, and the mean over all frames [m]."""
    if not free:
        return np.zeros(0), np.zeros(0), None
    means, frames = [], []
    for chain, simulated in zip(chains(test), free, strict=True):
        count = [len(step.t) for step in chain]
        if simulated is None:
            error = np.full(sum(count), np.nan)
        else:
            error = frame_rmse(np.concatenate([step.p_WE for step in chain]), simulated)
        means += [part.mean() for part in np.split(error, np.cumsum(count)[:-1])]
        frames += count
    by_step, weights = np.array(means), np.array(frames, dtype=float)
    total = float(np.sum(by_step * weights) / weights.sum())
    return by_step, weights, total if np.isfinite(total) else None

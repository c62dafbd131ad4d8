"""Predictions that know no physics: 'nothing moves' and 'repeat the same phase of the training cycles'."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.measures.steps import Step, repeats_of

NOTHING_MOVES = "nothing moves"
SAME_PHASE = "repeat the same phase"
LAST_CYCLE = "repeat the last cycle"

Carry = Literal["pose", "displacement"]
"""What is carried over from a training step: its pose as a whole, or what its caps moved since its start.

By pose, the shape at the start does not matter, as if cables that reach their targets forgot it; by displacement, it
is kept to the end, noise included.
"""


@dataclass(frozen=True)
class Repeat:
    """One training step carried over to a test step: key frame (cap, 3) [m], and how unlike the starts are [m].

    start_rmse_m: cap RMSE of the start poses after planar alignment.
    """

    run: str
    interval: int
    key: np.ndarray
    start_rmse_m: float


@dataclass(frozen=True)
class Baseline:
    """Predicted key frames (segment, cap, 3) [m] of the test steps; NaN where the baseline has nothing to say.

    repeats: by segment, the training steps that it rests on, empty where there are none.
    """

    name: str
    key: np.ndarray
    repeats: tuple[tuple[Repeat, ...], ...]

    @property
    def silent(self) -> tuple[int, ...]:
        """Rows of the test steps of which nothing is predicted."""
        return tuple(np.flatnonzero(~np.isfinite(self.key).all(axis=(1, 2))).tolist())


def nothing_moves(test: Sequence[Step], starts: np.ndarray | None = None) -> Baseline:
    """The end caps of the start stay where they are. starts: as in `same_phase`."""
    return Baseline(NOTHING_MOVES, _starts(test, starts).copy(), tuple(() for _ in test))


def same_phase(
    test: Sequence[Step], train: Sequence[Step], *, last_only: bool = False, by: Carry = "pose",
    starts: np.ndarray | None = None,
) -> Baseline:  # fmt: skip
    """Mean over the training steps of the same phase, each moved over the ground so that its start fits the test start.

    Same phase: same target vector, the same one before it, and standing on the same three caps at the start. The move
    is the planar alignment (x, y, yaw) of all caps at the start. by: see `Carry`. last_only: only the latest of these
    steps, 'repeat the last cycle'. starts: (segment, cap, 3) [m], where the start is known better than by its one
    frame; from frames at or before the start only. Nothing of the test step but its start is used, and a test step is
    never its own repeat, even if it stands in `train`.

    A phase that was never trained on is not predicted: its row is NaN, its repeats are empty. So is the first interval
    of a run, before which no target is known.
    """
    start = _starts(test, starts)
    repeats = []
    for row, step in enumerate(test):
        like = repeats_of(step, train)
        repeats.append(tuple(carry(one, start[row], by) for one in (like[-1:] if last_only else like)))
    key = np.full(start.shape, np.nan)
    for row, found in enumerate(repeats):
        if found:
            key[row] = np.mean([one.key for one in found], axis=0)
    return Baseline(LAST_CYCLE if last_only else SAME_PHASE, key, tuple(repeats))


def carry(training: Step, start: np.ndarray, by: Carry = "pose") -> Repeat:
    """The key frame of a training step as it would end from another start (cap, 3) [m]."""
    move = planar(training.start, start)
    moved = move.move(training.start)
    unlike = float(np.sqrt(np.sum((moved - start) ** 2, axis=-1).mean()))
    key = move.move(training.key) + (start - moved if by == "displacement" else 0.0)
    return Repeat(training.run, training.interval, key, unlike)


def _starts(test: Sequence[Step], starts: np.ndarray | None) -> np.ndarray:
    return np.array([step.start for step in test]) if starts is None else starts

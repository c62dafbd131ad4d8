"""The baselines in free run: one start, and what each says of every later frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.measures.baselines import Carry
from r2s2r_cli.stages.measures.steps import Step, repeats_of, support


def observed_run(chain: Sequence[Step]) -> tuple[np.ndarray, np.ndarray]:
    """Times (frame,) [s] and observed end caps (frame, cap, 3) [m] of steps that follow each other at once."""
    return np.concatenate([step.t for step in chain]), np.concatenate([step.p_WE for step in chain])


def free_nothing_moves(chain: Sequence[Step], start: np.ndarray | None = None) -> np.ndarray:
    """The start (cap, 3) [m] at every frame of the chain, (frame, cap, 3)."""
    t, _ = observed_run(chain)
    return np.broadcast_to(chain[0].start if start is None else start, (len(t), *chain[0].start.shape)).copy()


def free_same_phase(
    chain: Sequence[Step], train: Sequence[Step], *, last_only: bool = False, by: Carry = "pose",
    start: np.ndarray | None = None,
) -> np.ndarray | None:  # fmt: skip
    """Training steps of the same phases, one after the other, from one start (cap, 3) [m]; (frame, cap, 3) [m].

    Every step is carried over as in `baselines.same_phase`, from where the prediction before it ended; on which caps
    the robot stands there is predicted as well. Its time is scaled to the duration of the test step, which command
    replay knows, too, and linearly interpolated. What moves between the key frame and the start of the next interval
    is taken from the training step as well, if it was seen. None where some phase of the chain was never trained on:
    there is nothing to go on with.
    """
    now = chain[0].start if start is None else start
    frames = []
    for step in chain:
        like = repeats_of(step, train, standing=support(now))
        if not like:
            return None
        each = [carried(one, step, now, by) for one in (like[-1:] if last_only else like)]
        frames.append(np.mean([at_frames for at_frames, _ in each], axis=0))
        now = np.mean([after for _, after in each], axis=0)
    return np.concatenate(frames)


def carried(training: Step, step: Step, now: np.ndarray, by: Carry = "pose") -> tuple[np.ndarray, np.ndarray]:
    """One training step from pose `now` (cap, 3) [m]: at the frames of the test step (frame, cap, 3), and at the start
    of the interval after it."""
    move = planar(training.start, now)
    kept = now - move.move(training.start) if by == "displacement" else np.zeros_like(now)
    path = move.move(training.p_WE) + kept
    share, wanted = _share(training.t), _share(step.t)
    columns = path.reshape(len(share), -1).T
    at_frames = np.stack([np.interp(wanted, share, column) for column in columns], axis=-1)
    last = training.key if training.p_next is None else training.p_next
    return at_frames.reshape(len(wanted), *now.shape), move.move(last) + kept


def _share(t: np.ndarray) -> np.ndarray:
    """Times as a share of the step, 0 at its start and 1 at its key frame; a single frame is its start."""
    return (t - t[0]) / (t[-1] - t[0]) if len(t) > 1 else np.zeros(1)

"""The floor from steps of the same phase: how far the robot repeats itself, as the tracker sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.measures.baselines import Carry, carry
from r2s2r_cli.stages.measures.bootstrap import Interval, bootstrap
from r2s2r_cli.stages.measures.steps import Step, repeats_of

_ROUNDS = 3
"""Rounds of aligning to the mean start; the mean of poses that differ by millimetres moves no more after two."""


@dataclass(frozen=True)
class Floor:
    """Key-frame cap RMSE of a simulator with nothing wrong in it, started from one observed frame [m].

    interval: by bootstrap over the independent contrasts, None for fewer than two. contrasts: their number. sensor_m:
    the part of it that the noise of the start frame and of the key frame explains; repeatability_m: what is left of it.
    phases: (run, interval) of the steps it rests on, by phase.
    """

    floor_m: float
    interval: Interval | None
    contrasts: int
    sensor_m: float
    phases: tuple[tuple[tuple[str, int], ...], ...]

    @property
    def repeatability_m(self) -> float:
        """sqrt(floor^2 - sensor^2), 0 where the noise explains all [m]."""
        return float(np.sqrt(max(0.0, self.floor_m**2 - self.sensor_m**2)))


def floor_of(steps: Sequence[Step], *, by: Carry = "pose", level: float = 0.95, seed: int = 0) -> Floor | None:
    """From at least two steps of one phase (see `repeats_of`); None where there are none.

    Runs may be mixed, faulty steps are left out.

    Starts of one phase are laid on each other by planar moves, so that place and heading drop out; what is left is how
    the key frames differ. Of n of them, n - 1 orthogonal contrasts each have the expected square of the floor (the
    difference of two repeats has 2 floor^2, hence its half). Their mean over all phases is unbiased for independent
    repeats, and equals that of leaving one out: (error of the mean of the others)^2 (n - 1) / n.

    by: "pose" counts a start of another shape as part of the repeatability only as far as it is seen at the key frame,
    "displacement" all of it. A simulator that starts from the observed shape can be better than either. Slow drift of
    the robot along the run is counted as well. Which steps to use is the caller's: for a claim about test segments,
    training steps only.
    """
    groups = same_phase_groups(steps)
    if not groups:
        return None
    squares = np.concatenate([contrast_squares(aligned_keys(group, by)) for group in groups])
    used = [step for group in groups for step in group]
    return Floor(
        floor_m=float(np.sqrt(squares.mean())),
        interval=bootstrap(squares, level=level, seed=seed),
        contrasts=len(squares),
        sensor_m=float(np.sqrt(np.mean([_sensor_variance(step.noise, by) for step in used]))),
        phases=tuple(tuple((step.run, step.interval) for step in group) for group in groups),
    )


def same_phase_groups(steps: Sequence[Step]) -> list[list[Step]]:
    """Steps of one phase put together, groups of at least two, each step in one group."""
    found: list[list[Step]] = []
    taken: set[tuple[str, int]] = set()
    for step in steps:
        if step.faulty or (step.run, step.interval) in taken:
            continue
        group = [step, *repeats_of(step, steps)]
        taken |= {(one.run, one.interval) for one in group}
        if len(group) > 1:
            found.append(group)
    return found


def aligned_keys(group: Sequence[Step], by: Carry = "pose") -> np.ndarray:
    """Key frames of steps of one phase, each moved so that its start lies on their common start, (step, cap, 3) [m]."""
    common = group[0].start
    for _ in range(_ROUNDS):
        common = np.mean([planar(step.start, common).move(step.start) for step in group], axis=0)
    return np.array([carry(step, common, by).key for step in group])


def _sensor_variance(noise: np.ndarray, by: Carry) -> float:
    """What noise of sd (cap, 3) [m] at start and key frame adds to the mean squared 3-D error [m^2].

    The key frame counts in full; so does the start by displacement. By pose it enters through the alignment alone:
    x, y and yaw of n caps, 3 / n of the variance per horizontal axis.
    """
    key = float(np.sum(noise**2, axis=-1).mean())
    return 2.0 * key if by == "displacement" else key + 3.0 / len(noise) * float(np.mean(noise[:, :2] ** 2))


def contrast_squares(x: np.ndarray) -> np.ndarray:
    """Squares (n - 1,) of the Helmert contrasts of n repeats (n, cap, 3): mean over caps, summed over axes.

    Contrast k compares repeat k with the mean of those before it, scaled so that its expected square is that of a
    single repeat about its mean; for equal variances they are uncorrelated.
    """
    before = np.cumsum(x, axis=0)[:-1] / np.arange(1, len(x))[:, None, None]
    scale = np.arange(1, len(x)) / np.arange(2, len(x) + 1)
    return scale * np.sum((x[1:] - before) ** 2, axis=-1).mean(axis=-1)

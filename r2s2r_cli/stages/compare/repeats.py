"""How far the robot repeats itself: runs of one policy laid on each other at the start; and the floors that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.walk import Walk, same_targets
from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.measures.floor import contrast_squares


@dataclass(frozen=True)
class Repeatability:
    """Repeats of one policy. com_mean, com_sd (2,): where the centre of mass ended, from where it started, the heading
    at the start being the x axis [m]; turn_mean, turn_sd: how far it turned [rad], None without a heading;
    duration_mean, duration_sd [s]. Standard deviations are those of one run, with n - 1."""

    policy: str
    runs: tuple[str, ...]
    com_mean: np.ndarray
    com_sd: np.ndarray
    turn_mean: float | None
    turn_sd: float | None
    duration_mean: float
    duration_sd: float


@dataclass(frozen=True)
class Floors:
    """What a perfect simulator would be found to be wrong by, in a single run: root mean square of the repeats about
    their mean. com, path, cap, gait as in `RunErrors` [m]; heading [rad]; segment: duration of an interval [s].
    None: nothing repeats."""

    com: float | None = None
    heading: float | None = None
    segment: float | None = None
    path: float | None = None
    cap: float | None = None
    gait: float | None = None


SAME_START_M = 0.03
"""Runs whose first compared frames, laid on each other, differ by more than this (RMS of the caps) started on another
side of the robot or in another shape: they repeat nothing. Rest shapes differ by 5 to 20 mm within the tolerance of the
PID."""


def grouped(walks: Mapping[str, Walk], policies: Mapping[str, str]) -> list[list[str]]:
    """Names of runs that repeat each other: same policy, targets and shape at the start; groups of two or more."""
    found: list[list[str]] = []
    for name, walk in walks.items():
        for group in found:
            if policies[group[0]] == policies[name] and _repeats(walks[group[0]], walk):
                group.append(name)
                break
        else:
            found.append([name])
    return [group for group in found if len(group) > 1]


def _repeats(one: Walk, other: Walk) -> bool:
    if same_targets(one.intervals, other.intervals) < max(len(one.intervals), len(other.intervals)):
        return False
    away = planar(other.p_WE[0], one.p_WE[0]).move(other.p_WE[0]) - one.p_WE[0]
    return float(np.sqrt(np.mean(np.sum(away**2, axis=-1)))) < SAME_START_M


def repeatability(walks: Mapping[str, Walk], policies: Mapping[str, str]) -> tuple[Repeatability, ...]:
    """Of every group of runs that repeat each other."""
    return tuple(
        _of(policies[runs[0]], [walks[name] for name in runs], tuple(runs)) for runs in grouped(walks, policies)
    )


def floors(walks: Mapping[str, Walk], policies: Mapping[str, str]) -> Floors:
    """Over all runs that repeat each other; every orthogonal contrast of repeats counts once."""
    com, turn, segment = [], [], []
    path, cap, gait = [], [], []
    for runs in grouped(walks, policies):
        group = [walks[name] for name in runs]
        com.append(contrast_squares(np.array([ended(walk) for walk in group])[:, None, :]))
        at = np.array([walk.laid_on(group[0]).at_phase for walk in group])
        caps = at.reshape(len(group), -1, 3)
        cap.append(contrast_squares(caps))
        middle = np.einsum("c,ripcx->ripx", group[0].share, at)[..., :2]
        path.append(contrast_squares(middle.reshape(len(group), -1, 2)))
        ends = np.array([gait_ends(walk, group[0]) for walk in group])
        gait.append(contrast_squares(ends.reshape(len(group), -1, 3)))
        turns = [turned(walk) for walk in group]
        if all(one is not None for one in turns):
            turn.append(contrast_squares(np.array(turns, dtype=float)[:, None, None]))
        lasted = np.array([walk.durations for walk in group])
        segment.append(contrast_squares(lasted[:, :, None]))
    return Floors(*(_rms(one) for one in (com, turn, segment, path, cap, gait)))


def gait_ends(walk: Walk, onto: Walk) -> np.ndarray:
    """Caps at the end of each interval, laid on `onto` at the interval's start, (interval, cap, 3) [m]."""
    return np.array([
        planar(walk.p_WE[walk.intervals.first[k]], onto.p_WE[onto.intervals.first[k]]).move(walk.at_phase[k, -1])
        for k in range(len(walk.intervals))
    ])  # fmt: skip


def ended(walk: Walk) -> np.ndarray:
    """Where the centre of mass ended (2,) [m], from where it started, along and across the heading at the start.

    Without a heading along the axes of W: runs that started turned differently then differ by more than they repeat.
    """
    away = (walk.com[-1] - walk.com[0])[:2]
    if walk.first_heading is None:
        return away
    c, s = np.cos(walk.first_heading), np.sin(walk.first_heading)
    return np.array([c * away[0] + s * away[1], -s * away[0] + c * away[1]])


def turned(walk: Walk) -> float | None:
    """How far it turned from the first frame to the last [rad], whole turns counted."""
    return None if walk.heading is None else float(walk.heading[-1] - walk.heading[0])


def _of(policy: str, group: Sequence[Walk], runs: tuple[str, ...]) -> Repeatability:
    ends = np.array([ended(walk) for walk in group])
    turns = [turned(walk) for walk in group]
    known = np.array([one for one in turns if one is not None])
    whole = len(known) == len(group)
    lasted = np.array([walk.durations.sum() for walk in group])
    return Repeatability(
        policy, runs, ends.mean(axis=0), ends.std(axis=0, ddof=1),
        float(known.mean()) if whole else None, float(known.std(ddof=1)) if whole else None,
        float(lasted.mean()), float(lasted.std(ddof=1)),
    )  # fmt: skip


def _rms(squares: list[np.ndarray]) -> float | None:
    return float(np.sqrt(np.concatenate(squares).mean())) if squares else None

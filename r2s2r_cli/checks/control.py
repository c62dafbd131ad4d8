"""Targets, controls and what the motors said."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Run
from r2s2r_cli.control_sign import WRONG_SIGN, cable_response

ROUNDING = 1e-6
"""Of a logged position or control."""
POSITION_SLACK = 0.5
"""Cables overshoot, and lengths drift: half a range beyond either end is still a cable, a whole one is a unit."""
_KINDS = ("recording", "estimate", "simulation")


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="target positions lie between 0 (short) and 1 (long)",
    why="percentages or millimetres in their place make every target unreachable",
    fix=f"{AGAIN}   # first write targets in the source as positions 0 .. 1",
)
def targets_in_range(run: Run) -> Iterator[Found]:
    """Targets outside 0 .. 1. NaN (no target at that time) is allowed."""
    for stream, axis in (("commands", "row"), ("intervals", "interval")):
        target = run.array(stream, "target")
        if target is not None:
            outside = beyond(target, -ROUNDING, 1 + ROUNDING)
            if (outside > 0).any():
                yield Found(run.at(stream, "target"), "a target position is out of range", "0 (short) .. 1 (long)",
                            worst(target, outside, (axis, "cable")))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="motor commands lie between -1 and +1 (+1 reels in)",
    why="commands are a fraction of the maximum; raw motor values would be replayed as absurd speeds",
    fix=f"{AGAIN}   # first divide the commands in the source by their maximum",
)
def controls_in_range(run: Run) -> Iterator[Found]:
    """Commands outside -1 .. 1. NaN (not logged) is allowed."""
    for stream, name in (("commands", "control"), ("motors", "speed")):
        control = run.array(stream, name)
        if control is not None:
            outside = beyond(control, -1 - ROUNDING, 1 + ROUNDING)
            if (outside > 0).any():
                yield Found(run.at(stream, name), "a motor command is out of range", "-1 .. +1 (reels in)",
                            worst(control, outside, ("row", "cable")))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=("recording", "estimate"),
    what="motor commands above 0 shorten their cables",
    why="+1 reels in; with all signs exchanged a replay runs the gait backwards, and identification learns nonsense",
    fix=f"{AGAIN}   # first negate the control columns of the source",
)
def controls_shorten_cables(run: Run) -> Iterator[Found]:
    """Commands and cap distances that clearly go against each other over the whole run."""
    t_control, control, caps = run.array("commands", "t"), run.array("commands", "control"), run.p_WE
    robot, stamps = run.robot, run.stamps
    if t_control is None or control is None or caps is None or stamps is None or robot is None:
        return
    ends = np.array([robot.cables[k].caps for k in robot.actuated], dtype=int).reshape(-1, 2)
    length = np.linalg.norm(caps[1][:, ends[:, 0]] - caps[1][:, ends[:, 1]], axis=-1)
    response = cable_response(stamps[1], length, t_control, control)
    if response < WRONG_SIGN:
        yield Found(run.at("commands", "control"), "the commands have the wrong sign: they lengthen their cables",
                    "a positive correlation of command and shortening (+1 reels in)", number(response))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=("recording",),
    what="cable positions of the controller stay within half a range beyond 0 and 1",
    why="further out the length calibration or the controller's range is wrong, and the controller acted on it",
    fix="compare pid.min_length_m and pid.range_m in robot.toml with those of the run, and recalibrate the sensors",
)
def positions_plausible(run: Run) -> Iterator[Found]:
    """Positions far outside the range."""
    position = run.array("motors", "position")
    if position is not None:
        outside = beyond(position, -POSITION_SLACK, 1 + POSITION_SLACK)
        if (outside > 0).any():
            yield Found(run.at("motors", "position"), "a cable position is far out of range",
                        f"{-POSITION_SLACK:g} .. {1 + POSITION_SLACK:g}",
                        worst(position, outside, ("row", "cable")))  # fmt: skip


@check(
    "advice",
    Run,
    kinds=("recording",),
    what="the run has at least two target intervals",
    why="identification is judged on intervals that it was not fitted to: one interval cannot be split",
    fix="record a longer run, or import one with more target shapes",
)
def intervals_enough(run: Run) -> Iterator[Found]:
    """Runs that can only be looked at."""
    first = run.array("intervals", "first")
    if first is not None and len(first) < 2:
        yield Found(run.at("intervals"), "the run is too short to train on one part and judge on another",
                    "at least 2 target intervals", str(len(first)))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="within a target interval every command has the interval's target",
    why="a target interval is a time span of one constant target vector; everything is judged by intervals",
    fix=f"{AGAIN}   # the intervals are then found anew; those of an estimate are those of its recording",
)
def targets_constant(run: Run) -> Iterator[Found]:
    """Commands that contradict the interval they lie in."""
    t, target = run.array("commands", "t"), run.array("commands", "target")
    begin, end, own = (run.array("intervals", name) for name in ("t_first", "t_last", "target"))
    if t is None or target is None or begin is None or end is None or own is None:
        return
    if run.kept is not None and len(run.kept) == len(t):  # one row a frame: rows of dropped frames do not count
        t, target = t[run.kept], target[run.kept]
    for i in range(len(begin)):
        rows = (t >= begin[i]) & (t <= end[i])
        bad = np.abs(target[rows] - own[i])
        if (bad > ROUNDING).any():
            yield Found(run.at("intervals", "target"), f"a command in target interval {i + 1} has another target",
                        "the target of the interval", worst(target[rows], bad * (bad > ROUNDING),
                        ("row of the interval", "cable")))  # fmt: skip

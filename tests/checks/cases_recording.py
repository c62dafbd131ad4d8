"""Runs of a recording."""

from __future__ import annotations

import dataclasses

import numpy as np

from r2s2r_cli.checks.subjects import Run
from tests.checks.case import Case, Edge
from tests.support.check_subjects import edited, put, recording


def _moved(frames: object, offset: tuple[float, float, float]) -> Run:
    return edited(recording(), "caps/p_WE", _add(frames, offset))


def _add(place: object, number: object):  # type: ignore[no-untyped-def]
    def edit(array: np.ndarray) -> None:
        array[place] += number

    return edit


def _without_robot(run: Run) -> Run:
    return dataclasses.replace(run, project_robot=None)


def _two_caps() -> Run:
    streams = {name: group for name, group in recording().streams.items() if name in ("", "caps")}
    run = dataclasses.replace(recording(), streams=streams)
    return edited(
        edited(run, "caps/p_WE", recording().streams["caps"]["p_WE"][:, :2]), "caps/noise_sd", np.ones((2, 3))
    )


FAILS: tuple[Case, ...] = (
    Case(
        "time_increases",
        lambda: edited(recording(), "caps/t", put(3, 0.1)),
        (
            (
                "runs/a/caps/t",
                "the stamps of the kept frames do not increase",
                "each later than the one before",
                "0.2 s then 0.1 s at kept frame 3",
            ),
        ),
    ),
    Case(
        "kept_frames_apart",
        lambda: edited(recording(), "caps/t", put(3, 0.215)),
        (
            (
                "runs/a/caps/t",
                "two kept frames are one observation stamped twice",
                "gaps of at least 20 ms",
                "15 ms before kept frame 3",
            ),
        ),
    ),
    Case(
        "samples_ordered",
        lambda: edited(recording(), "sensors/t", put(7, 0.0)),
        (("runs/a/sensors/t", "the stamps run backwards", "in the order of time", "0.25 s then 0 s at sample 7"),),
    ),
    Case(
        "samples_ordered",
        lambda: edited(recording(), "imu/t", put(9, 0.0)),
        (
            (
                "runs/a/imu/t",
                "the stamps of board 1 run backwards",
                "in the order of time",
                "0.2917 s then 0 s at sample 4",
            ),
        ),
    ),
    Case(
        "counts_match_robot",
        _two_caps,
        (("runs/a", "the run has another number of end caps than the robot", "6 of robot threebar", "2"),),
    ),
    Case(
        "kept_frames_observed",
        lambda: edited(recording(), "caps/p_WE", put((slice(2, 4), 5), np.nan)),
        (
            (
                "runs/a/caps/p_WE",
                "a kept frame has a cap that was not observed",
                "all caps, or a drop_reason",
                "nan at kept frame 2, cap 5 (and 1 more)",
            ),
        ),
    ),
    Case(
        "rod_length_is_the_robots",
        lambda: edited(recording(), "caps/p_WE", lambda p: p.__imul__(0.9)),
        (
            ("runs/a/caps/p_WE", "rod 0 (red) has another length than in robot.toml", "325 mm within 5 %", "292.5 mm"),
            (
                "runs/a/caps/p_WE",
                "rod 1 (green) has another length than in robot.toml",
                "325 mm within 5 %",
                "292.5 mm",
            ),
            ("runs/a/caps/p_WE", "rod 2 (blue) has another length than in robot.toml", "325 mm within 5 %", "292.5 mm"),
        ),
    ),
    Case(
        "rods_keep_their_length",
        lambda: _moved((slice(0, 3), 1), (0.0, 0.1, 0.0)),
        (
            (
                "runs/a/caps/p_WE",
                "the length of rod 0 changes from frame to frame",
                "standard deviation of at most 10 mm",
                "16.84 mm",
            ),
        ),
    ),
    Case(
        "cable_lengths_in_limits",
        lambda: _moved((4, 5), (0.0, 0.0, 0.3)),
        (
            (
                "runs/a/caps/p_WE",
                "cable 6 has a length that the robot cannot have",
                "50 .. 350 mm",
                "389.5 mm at kept frame 4",
            ),
        ),
    ),
    Case(
        "caps_above_ground",
        lambda: _moved((slice(3, 5), slice(None)), (0.0, 0.0, -0.02)),
        (
            (
                "runs/a/caps/p_WE",
                "a cap lies below the ground",
                "the lowest point of every cap at 0 mm or above",
                "-20 mm at kept frame 3, cap 0 (and 5 more)",
            ),
        ),
    ),
    Case(
        "caps_below_ceiling",
        lambda: _moved((2, slice(None)), (0.0, 0.0, 0.3)),
        (
            (
                "runs/a/caps/p_WE",
                "a cap is higher than the robot can lift it",
                "at most 342.5 mm above the ground",
                "509.7 mm at kept frame 2, cap 1 (and 2 more)",
            ),
        ),
    ),
    Case(
        "caps_move_like_a_robot",
        lambda: _moved((3, 2), (0.0, 0.7, 0.0)),
        (
            (
                "runs/a/caps/p_WE",
                "a cap jumps on the way to the next kept frame",
                "at most 5 m/s",
                "7 m/s at kept frame 3, cap 2 (and 1 more)",
            ),
        ),
    ),
    Case(
        "targets_in_range",
        lambda: edited(recording(), "commands/target", put((4, 2), 1.5)),
        (
            (
                "runs/a/commands/target",
                "a target position is out of range",
                "0 (short) .. 1 (long)",
                "1.5 at row 4, cable 2",
            ),
        ),
    ),
    Case(
        "controls_in_range",
        lambda: edited(recording(), "commands/control", put(4, -99.0)),
        (
            (
                "runs/a/commands/control",
                "a motor command is out of range",
                "-1 .. +1 (reels in)",
                "-99 at row 4, cable 0 (and 5 more)",
            ),
        ),
    ),
    Case(
        "controls_in_range",
        lambda: edited(recording(), "motors/speed", put((0, 1), 2.0)),
        (("runs/a/motors/speed", "a motor command is out of range", "-1 .. +1 (reels in)", "2 at row 0, cable 1"),),
    ),
    Case(
        "positions_plausible",
        lambda: edited(recording(), "motors/position", put((20, 3), 2.0)),
        (("runs/a/motors/position", "a cable position is far out of range", "-0.5 .. 1.5", "2 at row 20, cable 3"),),
    ),
    Case(
        "targets_constant",
        lambda: edited(recording(), "commands/target", put((1, 2), 0.5)),
        (
            (
                "runs/a/intervals/target",
                "a command in target interval 1 has another target",
                "the target of the interval",
                "0.5 at row of the interval 1, cable 2",
            ),
        ),
    ),
    Case(
        "intervals_enough",
        lambda: _one_interval(),
        (
            (
                "runs/a/intervals",
                "the run is too short to train on one part and judge on another",
                "at least 2 target intervals",
                "1",
            ),
        ),
    ),
    Case(
        "spans_ordered",
        lambda: edited(recording(), "intervals/first", put(1, 2)),
        (
            (
                "runs/a/intervals",
                "target interval 2 is out of order",
                "frames after 2, the first before the last",
                "2 .. 5",
            ),
        ),
    ),
    Case(
        "spans_ordered",
        lambda: edited(recording(), "segments/last", put(0, -1)),
        (("runs/a/segments", "segment 1 is out of order", "frames after -1, the first before the last", "0 .. -1"),),
    ),
    Case(
        "spans_inside_frames",
        lambda: edited(recording(), "segments/last", put(1, 6)),
        (("runs/a/segments/last", "segment 2 ends after the last kept frame", "at most frame 5", "6"),),
    ),
    Case(
        "span_stamps_match",
        lambda: edited(recording(), "intervals/t_last", put(0, 0.25)),
        (("runs/a/intervals/t_last", "target interval 1 has another stamp than its frame", "0.2 s", "0.25 s"),),
    ),
    Case(
        "segments_in_their_interval",
        lambda: edited(recording(), "segments/interval", put(1, 1)),
        (
            (
                "runs/a/segments/interval",
                "segment 2 does not lie within its target interval 1",
                "frames 0 .. 2",
                "3 .. 5",
            ),
        ),
    ),
    Case(
        "segments_in_their_interval",
        lambda: edited(recording(), "segments/interval", put(1, 3)),
        (("runs/a/segments/interval", "segment 2 names a target interval that is not there", "1 .. 2", "3"),),
    ),
    Case(
        "directions_known",
        lambda: edited(recording(), "segments/direction", put((1, 4), 2)),
        (
            (
                "runs/a/segments/direction",
                "a direction is no sign",
                "-1 extends, 0 holds, +1 reels in",
                "2 at segment 2, cable 4",
            ),
        ),
    ),
)

EDGES: tuple[Edge, ...] = (
    Edge("time_increases", "dropped frames may run backwards", lambda: edited(recording(), "caps/t", put(6, -1.0))),
    Edge(
        "kept_frames_apart",
        "20 ms written in milliseconds",
        lambda: edited(recording(), "caps/t", put(5, 0.4 + 0.02 - 1e-7)),
    ),
    Edge("samples_ordered", "two samples may share a stamp", lambda: edited(recording(), "sensors/t", put(1, 0.0))),
    Edge("counts_match_robot", "the robot is not known", lambda: _without_robot(_two_caps())),
    Edge(
        "kept_frames_observed", "a dropped frame need not be", lambda: edited(recording(), "caps/p_WE", put(6, np.nan))
    ),
    Edge("rod_length_is_the_robots", "4 % off", lambda: edited(recording(), "caps/p_WE", lambda p: p.__imul__(0.96))),
    Edge("rod_length_is_the_robots", "no frames", lambda: _no_frames()),
    Edge("rods_keep_their_length", "no frames", lambda: _no_frames()),
    Edge("caps_move_like_a_robot", "no frames", lambda: _no_frames()),
    Edge("caps_above_ground", "9 mm deep", lambda: _moved((3, slice(None)), (0.0, 0.0, -0.009))),
    Edge(
        "caps_above_ground",
        "deep, and as noisy",
        lambda: edited(_moved((3, slice(None)), (0.0, 0.0, -0.02)), "caps/noise_sd", np.full((6, 3), 0.005)),
    ),
    Edge(
        "caps_above_ground",
        "the offset says where the ground is",
        lambda: edited(_moved(slice(None), (0.0, 0.0, -0.05)), "caps@ground_offset", 0.05),
    ),
    Edge("targets_in_range", "no target at that time", lambda: edited(recording(), "commands/target", put(4, np.nan))),
    Edge("targets_in_range", "rounded", lambda: edited(recording(), "commands/target", put(4, 1 + 1e-9))),
    Edge(
        "targets_constant",
        "commands between the intervals",
        lambda: edited(edited(recording(), "commands/t", put(3, 0.25)), "commands/target", put((3, 0), 0.5)),
    ),
    Edge("camera_pose_is_rigid", "text of four digits", lambda: edited(recording(), "camera/X_WC", put((0, 1), 1e-4))),
    Edge("spans_inside_frames", "the frames are not known", lambda: _only_spans()),
    Edge("intervals_enough", "none are known", lambda: dataclasses.replace(recording(), streams={})),
)


def _one_interval() -> Run:
    run = recording()
    group = run.streams["intervals"]
    for name in group.datasets:
        run = edited(run, f"intervals/{name}", group[name][:1])
    return run


def _no_frames() -> Run:
    return edited(recording(), "caps/drop_reason", put(slice(None), 1))


def _only_spans() -> Run:
    run = recording()
    return dataclasses.replace(run, streams={name: run.streams[name] for name in ("intervals", "segments")})

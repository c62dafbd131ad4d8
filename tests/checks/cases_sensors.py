"""Sensors, IMU and camera of a recording."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.checks.subjects import Links
from tests.checks.case import Case, Edge
from tests.support.check_subjects import edited, links, put, recording


def _recorded(warnings: list[str]) -> Links:
    head = links().header
    runs = [{"run": "a", "warnings": []}, {"run": "b", "warnings": warnings}]
    made = head.provenance.model_copy(update={"report": {"runs": runs}})
    return links(header=head.model_copy(update={"provenance": made}))


FAILS: tuple[Case, ...] = (
    Case(
        "recorded_without_warning",
        lambda: _recorded(["3 lines were corrupt", "ended at target 2 of 5: the link broke"]),
        (
            ("runs/b", "the recording warns of this run", "no warning", "3 lines were corrupt"),
            ("runs/b", "the recording warns of this run", "no warning", "ended at target 2 of 5: the link broke"),
        ),
    ),
    Case(
        "sensor_chip_initialised",
        lambda: edited(recording(), "sensors/capacitance", put((slice(0, 3), 4), 0.2e-12)),
        (
            (
                "runs/a/sensors/capacitance",
                "the chip of sensor 4 was not initialised",
                "a measurement",
                "0.20 pF in 3 of 25 samples",
            ),
        ),
    ),
    Case(
        "capacitance_in_farads",
        lambda: edited(recording(), "sensors/capacitance", put((slice(None), 2), 17.3)),
        (
            (
                "runs/a/sensors/capacitance",
                "sensor 2 has a capacitance of another unit",
                "0.1 pF .. 1000 pF",
                "median 1.73e+13 pF",
            ),
        ),
    ),
    Case(
        "sensors_move",
        lambda: edited(recording(), "sensors/length", put((slice(None), 6), 0.15)),
        (
            (
                "runs/a/sensors/length",
                "sensor 6 is frozen",
                "values that move as others do",
                "the same value in all 25 samples",
            ),
        ),
    ),
    Case(
        "sensors_move",
        lambda: edited(recording(), "sensors/length", put((slice(3, None), 6), 0.15)),
        (
            (
                "runs/a/sensors/length",
                "sensor 6 is frozen",
                "values that move as others do",
                "the same value in the last 22 of 25 samples",
            ),
        ),
    ),
    Case(
        "sensors_received",
        lambda: edited(recording(), "sensors/capacitance", put((slice(0, 20), 7), np.nan)),
        (("runs/a/sensors/capacitance", "sensor 7 was mostly not received", "at least 50 % of the samples", "20 %"),),
    ),
    Case(
        "sensor_lengths_in_limits",
        lambda: edited(recording(), "sensors/length", put((3, 1), 1.5)),
        (
            (
                "runs/a/sensors/length",
                "sensor 1 says a length that the robot cannot have",
                "50 .. 350 mm",
                "1500 mm at sample 3",
            ),
        ),
    ),
    Case(
        "sensor_cables_exist",
        lambda: edited(recording(), "sensors/cable", put(8, 9)),
        (("runs/a/sensors/cable", "a sensor names a cable that is not there", "0 .. 8", "9 at sensor 8"),),
    ),
    Case(
        "sensor_cables_exist",
        lambda: edited(recording(), "sensors/cable", put(8, 0)),
        (("runs/a/sensors/cable", "two sensors name the same cable", "one sensor a cable", "cable 0 twice"),),
    ),
    Case(
        "gravity_is_seen",
        lambda: edited(recording(), "imu/a_B", lambda a: a.__imul__(1 / 9.81)),
        (
            ("runs/a/imu/a_B", "board 0 does not feel gravity", "a median of 8 .. 12 m/s^2", "1 m/s^2"),
            ("runs/a/imu/a_B", "board 1 does not feel gravity", "a median of 8 .. 12 m/s^2", "1 m/s^2"),
        ),
    ),
    Case(
        "depth_pairs_exist",
        lambda: edited(recording(), "camera/pair", put(2, 2)),
        (
            (
                "runs/a/camera/pair",
                "a colour frame names a depth frame that is not there",
                "-1 (none) .. 1",
                "2 at colour frame 2",
            ),
        ),
    ),
    Case(
        "depth_pairs_close",
        lambda: edited(recording(), "camera/pair", put(2, 0)),
        (
            (
                "runs/a/camera/pair",
                "a colour frame and its depth frame are far apart in time",
                "at most 0.1 s",
                "0.19 s at colour frame 2",
            ),
        ),
    ),
    Case(
        "depth_scale_sensible",
        lambda: edited(recording(), "camera@depth_scale", 4000.0),
        (("runs/a/camera@depth_scale", "the depth scale is none of a camera", "1e-05 .. 0.01 m a count", "4000 m"),),
    ),
    Case(
        "intrinsics_sensible",
        lambda: edited(recording(), "camera@fx", -600.0),
        (("runs/a/camera@fx", "a focal length is not positive", "above 0 px", "-600 px"),),
    ),
    Case(
        "intrinsics_sensible",
        lambda: edited(recording(), "camera@cy", 640.0),
        (("runs/a/camera@cy", "the principal point lies outside the image", "0 .. 480 px", "640 px"),),
    ),
    Case(
        "camera_pose_is_rigid",
        lambda: edited(recording(), "camera/X_WC", put((0, 0), 1.1)),
        (("runs/a/camera/X_WC", "the pose of the camera is no rotation", "R^T R = 1", "off by 0.21"),),
    ),
    Case(
        "camera_pose_is_rigid",
        lambda: edited(recording(), "camera/X_WC", put((2, 2), -1.0)),
        (("runs/a/camera/X_WC", "the pose of the camera mirrors", "determinant +1", "-1"),),
    ),
    Case(
        "camera_pose_is_rigid",
        lambda: edited(recording(), "camera/X_WC", put((3, 0), 0.5)),
        (("runs/a/camera/X_WC", "the last row of the camera's pose is not 0 0 0 1", "0 0 0 1", "0.5 0 0 1"),),
    ),
)

EDGES: tuple[Edge, ...] = (
    Edge("recorded_without_warning", "a run without warnings", lambda: _recorded([])),
    Edge("recorded_without_warning", "a recording of another program has no report", links),
    Edge(
        "sensor_chip_initialised",
        "0.21 pF is a measurement",
        lambda: edited(recording(), "sensors/capacitance", put((0, 4), 0.21e-12)),
    ),
    Edge("sensors_move", "nothing moves", lambda: edited(recording(), "sensors/length", put(slice(None), 0.15))),
    Edge(
        "sensors_move",
        "the chip is off: another check says so",
        lambda: edited(recording(), "sensors/capacitance", put((slice(None), 4), 0.2e-12)),
    ),
    Edge(
        "sensors_move",
        "a sensor of few digits, which had said the same for three samples before",
        lambda: edited(
            edited(recording(), "sensors/length", put((slice(0, 3), 6), 0.14)),
            "sensors/length",
            put((slice(3, None), 6), 0.15),
        ),
    ),
    Edge(
        "sensors_received",
        "half of them",
        lambda: edited(recording(), "sensors/capacitance", put((slice(0, 12), 7), np.nan)),
    ),
    Edge(
        "sensors_received",
        "three boards take turns",
        lambda: edited(
            edited(recording(), "sensors/board", put(slice(None), np.arange(25) % 3)),
            "sensors/capacitance",
            put(np.arange(25)[:, None] % 3 != np.arange(9) % 3, np.nan),
        ),
    ),
    Edge(
        "depth_pairs_close",
        "pairs that do not exist are for another check",
        lambda: edited(recording(), "camera/pair", put(2, 99)),
    ),
    Edge("depth_scale_sensible", "a RealSense", lambda: edited(recording(), "camera@depth_scale", 1 / 4000)),
)

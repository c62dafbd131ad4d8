"""Runs of estimates and simulations."""

from __future__ import annotations

import dataclasses

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.checks.subjects import Run
from tests.checks.case import Case, Edge
from tests.support.check_subjects import edited, estimate, put, recording, simulation


def _scaled(run: Run, path: str, factor: float) -> Run:
    return edited(run, path, lambda array: array.__imul__(factor))


def _with(run: Run, stream: str, **datasets: np.ndarray) -> Run:
    """The run with more datasets, of camera images."""
    group = run.streams.get(stream, Group())
    made = Group({**group.datasets, **datasets}, group.attributes)
    return dataclasses.replace(run, streams={**run.streams, stream: made})


def _swapped_order(run: Run) -> Run:
    """Quaternions written wxyz, as MuJoCo has them."""
    q = run.streams["frames"]["q_WR"]
    return edited(run, "frames/q_WR", np.roll(q, 1, axis=-1))


def _rolling() -> Run:
    run = estimate()
    p = run.streams["frames"]["p_WE"]
    axis = p[:, 1::2] - p[:, 0::2]
    return edited(run, "frames/w_WR", axis / np.linalg.norm(axis, axis=-1, keepdims=True))


def _covariance(matrix: list[list[float]]) -> Run:
    return edited(estimate(), "frames/cov_p_WE", put((4, 1), 1e-6 * np.array(matrix)))


FAILS: tuple[Case, ...] = (
    Case(
        "time_increases",
        lambda: edited(estimate(), "frames/t", put(0, 0.1)),
        (
            (
                "runs/a/frames/t",
                "the stamps of the frames do not increase",
                "each later than the one before",
                "0.1 s then 0.1 s at frame 1",
            ),
        ),
    ),
    Case(
        "source_frames_increase",
        lambda: edited(estimate(), "frames/source_frame", put(2, 1)),
        (
            (
                "runs/a/frames/source_frame",
                "the frames are not in the order of the recording",
                "rows that increase from 0 on",
                "1 at frame 2",
            ),
        ),
    ),
    Case(
        "source_frames_increase",
        lambda: edited(estimate(), "frames/source_frame", put(0, -1)),
        (
            (
                "runs/a/frames/source_frame",
                "the frames are not in the order of the recording",
                "rows that increase from 0 on",
                "-1 at frame 0",
            ),
        ),
    ),
    Case(
        "caps_above_ground",
        lambda: edited(simulation(), "frames/p_WE", put((5, 0, 2), -0.1)),
        (
            (
                "runs/a/frames/p_WE",
                "a cap lies below the ground",
                "the lowest point of every cap at 0 mm or above",
                "-117.5 mm at frame 5, cap 0",
            ),
        ),
    ),
    Case(
        "caps_below_ceiling",
        lambda: edited(estimate(), "frames/p_WE", put((5, 0, 2), 0.5)),
        (
            (
                "runs/a/frames/p_WE",
                "a cap is higher than the robot can lift it",
                "at most 342.5 mm above the ground",
                "500 mm at frame 5, cap 0",
            ),
        ),
    ),
    Case(
        "quaternions_are_unit",
        lambda: edited(estimate(), "frames/q_WR", put((2, 1), 0.0)),
        (("runs/a/frames/q_WR", "a quaternion is not of length 1", "1", "0 at frame 2, rod 1"),),
    ),
    Case(
        "quaternions_are_unit",
        lambda: _scaled(recording(), "camera_pose/q_WC", 2.0),
        (("runs/a/camera_pose/q_WC", "a quaternion is not of length 1", "1", "2 at sample 0 (and 24 more)"),),
    ),
    Case(
        "rods_are_rigid",
        lambda: _scaled(edited(simulation(), "frames/p_WE", put((1, 3, 0), 0.2)), "frames/t", 1.0),
        (("runs/a/frames/p_WE", "rod 1 changes its length", "325 mm within 1 mm", "385.5 mm at frame 1"),),
    ),
    Case(
        "poses_match_caps",
        lambda: edited(estimate(), "frames/p_WR", put((3, 2), 0.0)),
        (
            (
                "runs/a/frames/p_WR",
                "a rod is not in the middle between its caps",
                "within 1 mm",
                "104.6 mm at frame 3, rod 2",
            ),
        ),
    ),
    Case(
        "poses_match_caps",
        lambda: _swapped_order(simulation()),
        (
            (
                "runs/a/frames/q_WR",
                "a rod does not point from its even to its odd cap",
                "within 0.6 degrees",
                "95.66 degrees at frame 0, rod 0 (and 17 more)",
            ),
        ),
    ),
    Case(
        "speeds_are_sane",
        lambda: edited(estimate(), "frames/v_WE", put((1, 4, 2), 30.0)),
        (("runs/a/frames/v_WE", "a velocity is absurd", "at most 5 m/s", "30 m/s at frame 1, cap 4"),),
    ),
    Case(
        "speeds_are_sane",
        lambda: edited(simulation(), "frames/w_WR", put((5, 0, 1), -1e6)),
        (("runs/a/frames/w_WR", "a velocity is absurd", "at most 100 rad/s", "1e+06 rad/s at frame 5, rod 0"),),
    ),
    Case(
        "contacts_near_ground",
        lambda: edited(estimate(), "frames/contact", put(slice(None), True)),
        (
            (
                "runs/a/frames/contact",
                "a cap high above the ground is said to touch it",
                "its lowest point below 20 mm",
                "192.2 mm at frame 0, cap 1 (and 17 more)",
            ),
        ),
    ),
    Case(
        "lengths_match_caps",
        lambda: edited(simulation(), "frames/length", lambda x: x.__iadd__(0.002)),
        (
            (
                "runs/a/frames/length",
                "the length of a cable is not the distance of its caps",
                "within 1 mm",
                "off by 2 mm at frame 0, cable 0 (and 53 more)",
            ),
        ),
    ),
    Case(
        "covariances_are_valid",
        lambda: _covariance([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]),
        (
            (
                "runs/a/frames/cov_p_WE",
                "a covariance is not symmetric",
                "equal to its transpose",
                "off by 0.5 at frame 4, cap 1",
            ),
        ),
    ),
    Case(
        "covariances_are_valid",
        lambda: _covariance([[1, 2, 0], [2, 1, 0], [0, 0, 1]]),
        (
            (
                "runs/a/frames/cov_p_WE",
                "a covariance has a negative variance",
                "0 or more in every direction",
                "-1e-06 m^2 at frame 4, cap 1",
            ),
        ),
    ),
    Case(
        "deviations_are_positive",
        lambda: edited(estimate(), "frames/length_sd", put((0, 3), -1e-3)),
        (("runs/a/frames/length_sd", "a standard deviation is too small", "0 or more", "-0.001 at frame 0, cable 3"),),
    ),
    Case(
        "deviations_are_positive",
        lambda: edited(estimate(), "tracks/noise_sd", put((5, 2), 0.0)),
        (("runs/a/tracks/noise_sd", "a standard deviation is too small", "above 0", "0 at cap 5, axis 2"),),
    ),
    Case(
        "probabilities_in_range",
        lambda: edited(estimate(), "frames/contact_probability", put((2, 2), 1.01)),
        (("runs/a/frames/contact_probability", "a probability is out of range", "0 .. 1", "1.01 at frame 2, cap 2"),),
    ),
    Case(
        "ground_normal_is_unit",
        lambda: _scaled(estimate(), "ground/normal", 1000.0),
        (("runs/a/ground/normal", "the normal of the ground is not of length 1", "1", "1000"),),
    ),
    Case(
        "roll_is_not_invented",
        _rolling,
        (
            (
                "runs/a/frames/w_WR",
                "a rod turns about its own axis although nobody saw its roll",
                "0 rad/s",
                "1 rad/s at frame 0, rod 0 (and 17 more)",
            ),
        ),
    ),
    Case(
        "caps_well_observed",
        lambda: edited(estimate(), "frames/quality", put((slice(0, 3), 2), 1)),
        (("runs/a/frames/quality", "cap 2 was seldom observed", "used in at least 80 % of the frames", "50 %"),),
    ),
    Case(
        "noise_as_assumed",
        lambda: edited(estimate(), "tracks/innovation_variance", put(4, 3.5)),
        (
            (
                "runs/a/tracks/innovation_variance",
                "the noise is not as large as was assumed",
                "0.5 .. 2",
                "3.5 at cap 4",
            ),
        ),
    ),
    Case(
        "seldom_lost",
        lambda: _with(estimate(), "frames", mode=np.array([8, 0, 0, 10, 2, 0], np.uint8)),
        (("runs/a/frames/mode", "the robot was lost for a time", "at most 5 % of the frames", "33.3 %"),),
    ),
    Case(
        "sensors_agree_with_camera",
        lambda: _with(estimate(), "sensor_fit", dead=np.array([False, True, False, True])),
        (
            (
                "runs/a/sensor_fit/dead",
                "cable sensors were not used: they contradict what was seen, or are silent",
                "every sensor used",
                "not that of cable 1, 3",
            ),
        ),
    ),
    Case(
        "cables_never_push",
        lambda: edited(simulation(), "frames/tension", put((3, 7), -2.5)),
        (("runs/a/frames/tension", "a cable pushes", "a tension of 0 N or more", "-2.5 N at frame 3, cable 7"),),
    ),
    Case(
        "rest_lengths_positive",
        lambda: edited(simulation(), "frames/rest_length", put((3, 7), 0.0)),
        (("runs/a/frames/rest_length", "a cable has no length left", "above 0 mm", "0 mm at frame 3, cable 7"),),
    ),
    Case(
        "step_fits_frames",
        lambda: edited(simulation(), "@step", 0.5),
        (("runs/a@step", "the time step does not fit the stored frames", "above 0 s, at most 0.1 s", "0.5 s"),),
    ),
)

EDGES: tuple[Edge, ...] = (
    Edge("quaternions_are_unit", "both signs are one rotation", lambda: _scaled(estimate(), "frames/q_WR", -1.0)),
    Edge("poses_match_caps", "both signs are one rotation", lambda: _scaled(estimate(), "frames/q_WR", -1.0)),
    Edge(
        "covariances_are_valid", "no variance in one direction", lambda: _covariance([[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    ),
    Edge("roll_is_not_invented", "the roll was observed", lambda: edited(_rolling(), "frames@roll_observable", True)),
    Edge(
        "deviations_are_positive", "a velocity known exactly", lambda: edited(estimate(), "frames/sd_v_WE", put(0, 0.0))
    ),
    Edge("caps_well_observed", "a jump was used", lambda: edited(estimate(), "frames/quality", put(slice(None), 3))),
    Edge("caps_well_observed", "no frames", lambda: edited(estimate(), "frames/quality", np.zeros((0, 6), np.uint8))),
    Edge("seldom_lost", "hidden is not lost", lambda: _with(estimate(), "frames", mode=np.full(6, 7, np.uint8))),
    Edge("seldom_lost", "no frames", lambda: _with(estimate(), "frames", mode=np.zeros(0, np.uint8))),
    Edge("sensors_agree_with_camera", "all used", lambda: _with(estimate(), "sensor_fit", dead=np.zeros(9, bool))),
    Edge("cables_never_push", "rounding", lambda: edited(simulation(), "frames/tension", put((3, 7), -1e-12))),
    Edge("step_fits_frames", "one step a frame", lambda: edited(simulation(), "@step", 0.1)),
    Edge("rods_are_rigid", "no caps", lambda: Run("estimate", "a", {"frames": Group()})),
)

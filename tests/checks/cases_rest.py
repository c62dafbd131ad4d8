"""Calibrations, policies, robot descriptions."""

from __future__ import annotations

import numpy as np

from schemas.robot import Robot
from tests.checks.case import Case, Edge
from tests.support.check_subjects import calibration, edited_content, policy, put, robot

KEEP = np.array([[0.0] * 6, [0.0] * 6, [1.0] * 6])


def _robot(**changes: object) -> Robot:
    return robot().model_copy(update=changes)


def _cable(index: int, **changes: object) -> Robot:
    cables = list(robot().cables)
    cables[index] = cables[index].model_copy(update=changes)
    return _robot(cables=tuple(cables))


def _lifted(by: float) -> Robot:
    return _robot(rest_caps_m=tuple((x, y, z + by) for x, y, z in robot().rest_caps_m))


FAILS: tuple[Case, ...] = (
    Case(
        "calibration_rows_exist",
        lambda: edited_content(calibration(), "points/set", put(1, 2)),
        (
            (
                "points/set",
                "a row of points names a row of lines that is not there",
                "0 .. 1, rows of lines",
                "2 at row 1",
            ),
        ),
    ),
    Case(
        "calibration_rows_exist",
        lambda: edited_content(calibration(), "drift/before", put(0, -1)),
        (
            (
                "drift/before",
                "a row of drift names a row of history that is not there",
                "0 .. 2, rows of history",
                "-1 at row 0",
            ),
        ),
    ),
    Case(
        "sensors_are_alive",
        lambda: edited_content(calibration(), "lines/state", put((1, 3), 1)),
        (
            (
                "lines/state",
                "sensor 3 of set new cannot be used",
                "a line that rises",
                "dead: the slope cannot be told from zero",
            ),
        ),
    ),
    Case(
        "residuals_are_small",
        lambda: edited_content(calibration(), "lines/rms", put((1, slice(2, 4)), 0.0065)),
        (
            (
                "lines/rms",
                "a line of set new does not fit its points",
                "at most 4 mm rms",
                "6.5 mm at sensor 2 (and 1 more)",
            ),
        ),
    ),
    Case(
        "tendons_rise",
        lambda: edited_content(
            edited_content(calibration(), "tendons/monotone", put(1, False)), "tendons/stiffness_min", put(1, -12.0)
        ),
        (("tendons/monotone", "the fit of curve t2 falls with the stretch", "a slope above 0 N/m", "-12 N/m"),),
    ),
    Case(
        "tendons_rise",
        lambda: edited_content(calibration(), "tendons@monotone", False),
        (
            (
                "tendons@monotone",
                "the average of the curves falls with the stretch",
                "a slope above 0 N/m",
                "a slope below it on the common range",
            ),
        ),
    ),
    Case(
        "masses_make_a_rod",
        lambda: edited_content(calibration(), "masses/mass", put(2, 0.0)),
        (("masses/mass", "mass of a rod is not above 0", "above 0 kg", "0 kg at row 2"),),
    ),
    Case(
        "masses_make_a_rod",
        lambda: edited_content(calibration(), "masses/inertia_axial", put(0, 0.1)),
        (
            (
                "masses/inertia_axial",
                "a rod is harder to turn about its axis than across",
                "less than inertia_transverse",
                "0.1 kg m^2 at row 0",
            ),
        ),
    ),
    Case(
        "history_is_sound",
        lambda: edited_content(calibration(), "history/state", put(([0, 2], [4, 1]), 1)),
        (
            (
                "history/state",
                "the history holds fits that failed or are suspect",
                "lines that rise",
                "2 of 27, of sensor 1, 4",
            ),
        ),
    ),
    Case(
        "policy_robot_known",
        lambda: policy(robot_name="sixbar"),
        (("robot", "the policy is for another robot", "threebar", "sixbar"),),
    ),
    Case(
        "policy_robot_known",
        lambda: policy(robot_name="sixbar", root="policies/crawl"),
        (("policies/crawl@robot", "the policy is for another robot", "threebar", "sixbar"),),
    ),
    Case(
        "policy_fits_cables",
        lambda: policy(target=np.array([[0.0] * 9, [1.0] * 9])),
        (("steps", "a step has another number of targets than the robot has actuated cables", "6", "9"),),
    ),
    Case(
        "policy_targets_in_range",
        lambda: policy(target=np.array([[0.0] * 6, [95.0] * 6])),
        (
            (
                "steps",
                "a target position is out of range",
                "0 (short) .. 1 (long)",
                "95 at step 1, cable 0 (and 5 more)",
            ),
        ),
    ),
    Case(
        "policy_times_sensible",
        lambda: policy(hold=np.array([0.0, -1.0])),
        (("steps", "the hold of a step is too short", "0 s or more", "-1 s at step 1"),),
    ),
    Case(
        "policy_times_sensible",
        lambda: policy(timeout=np.array([0.0, np.nan])),
        (("steps", "the timeout of a step is too short", "above 0 s", "0 s at step 0"),),
    ),
    Case(
        "policy_times_sensible",
        lambda: policy(repeat=0, root="policies/crawl"),
        (("policies/crawl@repeat", "the policy is never run", "1 or more", "0"),),
    ),
    Case(
        "policy_steps_differ",
        lambda: policy(target=KEEP),
        (("steps", "a step has the target of the step before it", "another target", "step 1 repeats step 0"),),
    ),
    Case(
        "policy_steps_differ",
        lambda: policy(target=KEEP[[0, 2, 1]], repeat=2),
        (("steps", "a step has the target of the step before it", "another target", "step 0 repeats step 2"),),
    ),
    Case(
        "rest_pose_fits_rods",
        lambda: _robot(rest_caps_m=robot().rest_caps_m[:5]),
        (("rest_caps_m", "the rest pose has another number of caps than the robot", "6", "5"),),
    ),
    Case(
        "rest_pose_fits_rods",
        lambda: _robot(
            rods=tuple(rod.model_copy(update={"length_m": 0.36}) for rod in robot().rods[:1]) + robot().rods[1:]
        ),
        (("rest_caps_m", "rod 0 (red) has another length in the rest pose", "360 mm within 5 mm", "325 mm"),),
    ),
    Case(
        "rest_pose_on_ground",
        lambda: _lifted(0.1),
        (
            (
                "rest_caps_m",
                "the robot does not lie on the ground in its rest pose",
                "0 mm",
                "lowest point of a cap at 100 mm",
            ),
        ),
    ),
    Case(
        "sites_on_their_caps",
        lambda: _cable(4, sites_m=((0.0, 0.0, 0.1625), robot().cables[4].sites_m[1])),
        (
            (
                "cables.4.sites_m.0",
                "cable 4 is attached away from cap 0",
                "at most 26.25 mm from its centre",
                "325 mm, nearer to the other cap of the rod",
            ),
        ),
    ),
    Case(
        "pid_range_in_limits",
        lambda: _robot(pid=robot().pid.model_copy(update={"range_m": 0.3})),
        (("pid", "the controller asks for lengths outside the limits", "50 .. 350 mm", "95 .. 395 mm"),),
    ),
    Case(
        "sensors_are_calibrated",
        lambda: _robot(
            sensors=tuple(s.model_copy(update={"slope_f_per_m": None}) for s in robot().sensors[:2])
            + robot().sensors[2:]
        ),
        (
            (
                "sensors",
                "sensors are not calibrated",
                "slope_f_per_m and offset_f of every sensor",
                "none for sensor 0, 1",
            ),
        ),
    ),
    Case(
        "robot_was_measured",
        lambda: _robot(illustrative=True),
        (
            (
                "illustrative",
                "this robot was made up",
                "a measured robot",
                "untethered 3-bar prismatic tensegrity, 36 cm rods: the robot of the paper",
            ),
        ),
    ),
)

EDGES: tuple[Edge, ...] = (
    Edge(
        "sensors_are_alive",
        "a set that is not in use",
        lambda: edited_content(calibration(), "lines/state", put((0, 3), 1)),
    ),
    Edge(
        "residuals_are_small",
        "a dead sensor has none",
        lambda: edited_content(calibration(), "lines/rms", put(1, np.nan)),
    ),
    Edge("policy_robot_known", "no project", lambda: policy(robot_name="sixbar", project_robot=None)),
    Edge("policy_fits_cables", "another robot", lambda: policy(robot_name="sixbar", target=np.zeros((1, 24)))),
    Edge("policy_targets_in_range", "the ends", lambda: policy(target=np.array([[0.0, 1.0]]))),
    Edge("policy_times_sensible", "the robot's own time out", lambda: policy(timeout=np.full(2, np.nan))),
    Edge("policy_steps_differ", "one step, repeated, is a way to wait", lambda: policy(target=KEEP[:1], repeat=3)),
    Edge(
        "rest_pose_fits_rods",
        "3 mm off",
        lambda: _robot(rods=tuple(rod.model_copy(update={"length_m": 0.328}) for rod in robot().rods)),
    ),
    Edge("rest_pose_on_ground", "3 mm up", lambda: _lifted(0.003)),
    Edge(
        "sites_on_their_caps",
        "in the middle of the cap",
        lambda: _cable(4, sites_m=tuple((0.0, 0.0, 0.1625 if cap % 2 else -0.1625) for cap in robot().cables[4].caps)),
    ),
    Edge("sensors_are_calibrated", "a robot without sensors", lambda: _robot(sensors=())),
)

"""The robot description: do its numbers make one robot?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import Found, check, number
from schemas.robot import Robot

REST_TOLERANCE_M = 0.005
"""A rest pose measured with a rule; simulation starts from it and pulls the rods to their length."""
SITE_FACTOR = 1.5
"""Cables are tied to the surface of a cap or in it; a knot or ring may stand out by half a radius."""


@check(
    "error",
    Robot,
    what="there is one rest position for each end cap, and the rods have their length there, within 5 mm",
    why="the simulator starts from the rest pose; wrong lengths there are an explosion in the first step",
    fix="correct rest_caps_m or rods.length_m (cap centre to cap centre) in {file}",
)
def rest_pose_fits_rods(robot: Robot) -> Iterator[Found]:
    """A rest pose of another robot."""
    if len(robot.rest_caps_m) != robot.n_caps:
        yield Found("rest_caps_m", "the rest pose has another number of caps than the robot", str(robot.n_caps),
                    str(len(robot.rest_caps_m)))  # fmt: skip
        return
    caps = np.array(robot.rest_caps_m)
    for i, rod in enumerate(robot.rods):
        length = float(np.linalg.norm(caps[2 * i + 1] - caps[2 * i]))
        if abs(length - rod.length_m) > REST_TOLERANCE_M:
            yield Found("rest_caps_m", f"rod {i} ({rod.name}) has another length in the rest pose",
                        f"{number(rod.length_m, 1e3)} mm within {number(REST_TOLERANCE_M, 1e3)} mm",
                        f"{number(length, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Robot,
    what="the robot lies on the ground in its rest pose: its lowest cap touches z = 0 within 5 mm",
    why="a robot that starts in the air falls, and one that starts in the ground is thrown out",
    fix="add the difference to every z of rest_caps_m in {file}",
)
def rest_pose_on_ground(robot: Robot) -> Iterator[Found]:
    """A rest pose in the air or in the ground."""
    if len(robot.rest_caps_m) != robot.n_caps:
        return
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    lowest = float((np.array(robot.rest_caps_m)[:, 2] - radius).min())
    if abs(lowest) > REST_TOLERANCE_M:
        yield Found("rest_caps_m", "the robot does not lie on the ground in its rest pose", "0 mm",
                    f"lowest point of a cap at {number(lowest, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Robot,
    what="cables are attached to their end caps: at most 1.5 cap radii from the centre",
    why="attachment points decide the torque on a rod; one at a wrong rod end turns it the wrong way",
    fix="correct sites_m of the named cable in {file}, or derive them again with r2s2r init in another directory",
)
def sites_on_their_caps(robot: Robot) -> Iterator[Found]:
    """Attachment points away from their cap."""
    for i, cable in enumerate(robot.cables):
        for end, (cap, site) in enumerate(zip(cable.caps, cable.sites_m, strict=True)):
            rod = robot.rods[cap // 2]
            centre = np.array([0.0, 0.0, rod.length_m / 2 * (1 if cap % 2 else -1)])
            distance = float(np.linalg.norm(np.array(site) - centre))
            if distance > SITE_FACTOR * rod.cap_radius_m:
                yield Found(f"cables.{i}.sites_m.{end}", f"cable {i} is attached away from cap {cap}",
                            f"at most {number(SITE_FACTOR * rod.cap_radius_m, 1e3)} mm from its centre",
                            f"{number(distance, 1e3)} mm")  # fmt: skip


@check(
    "error",
    Robot,
    what="the controller's range of lengths lies within the limits of the cables",
    why="a target at 0 or 1 would be a length that the host's safety check refuses",
    fix="correct pid.min_length_m, pid.range_m or [limits] in {file}",
)
def pid_range_in_limits(robot: Robot) -> Iterator[Found]:
    """A controller that asks for what the limits forbid."""
    low, high = robot.pid.min_length_m, robot.pid.min_length_m + robot.pid.range_m
    least, most = robot.limits.cable_length_min_m, robot.limits.cable_length_max_m
    if low < least or high > most:
        yield Found("pid", "the controller asks for lengths outside the limits",
                    f"{number(least, 1e3)} .. {number(most, 1e3)} mm",
                    f"{number(low, 1e3)} .. {number(high, 1e3)} mm")  # fmt: skip


@check(
    "advice",
    Robot,
    what="every sensor is calibrated",
    why="without slope and offset its capacitance says nothing about the length",
    fix="r2s2r calibrate with a table of length and capacitance",
)
def sensors_are_calibrated(robot: Robot) -> Iterator[Found]:
    """Sensors without a line."""
    missing = [i for i, sensor in enumerate(robot.sensors) if sensor.slope_f_per_m is None or sensor.offset_f is None]
    if missing:
        yield Found("sensors", "sensors are not calibrated", "slope_f_per_m and offset_f of every sensor",
                    f"none for sensor {', '.join(map(str, missing))}")  # fmt: skip


@check(
    "advice",
    Robot,
    what="the robot is one that was measured",
    why="numbers of an illustrative robot were made up, and so is everything computed with them",
    fix="r2s2r init --robot threebar in another directory, or measure your robot and set illustrative = false",
)
def robot_was_measured(robot: Robot) -> Iterator[Found]:
    """A made-up robot."""
    if robot.illustrative:
        yield Found("illustrative", "this robot was made up", "a measured robot", robot.title)

"""The robot description, what moves and measures its cables: winches, controller, tendons, sensors."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.checks.base import Found, check, number
from schemas.robot import Robot

WINCH_SHARE = 0.1
"""A winch is a hundredth of the length of a rod in radius; a tenth is centimetres for millimetres."""
TRAVEL_MIN_S = 0.2
"""Shortest time over a cable's whole range. The 3-bar robot takes 1.6 s; with its speed in rpm it would take 0.16 s."""
ROUNDING_M = 1e-9
"""0.1 + 0.2 is a little more than 0.3."""
CAPACITANCE_F = (0.1e-12, 1e-9)
"""Stretch sensors have 10-40 pF; outside this over the cable's limits, slope or offset has another unit."""


@check(
    "warning",
    Robot,
    what="winches are thinner than a tenth of the shortest rod is long, and need 0.2 s or more over a cable's range",
    why="radius and speed of the winch set the speed of every simulated cable; rpm or centimetres make it ten times",
    fix="give winch_radius_m in metres and no_load_rad_per_s in rad/s (rpm / 9.55) in {file}",
)
def winches_plausible(robot: Robot) -> Iterator[Found]:
    """Winches of another robot, or of another unit."""
    most = WINCH_SHARE * min(rod.length_m for rod in robot.rods)
    for i, motor in enumerate(robot.motors):
        travel = robot.pid.range_m / (motor.no_load_rad_per_s * motor.speed * motor.winch_radius_m)
        if motor.winch_radius_m > most:
            yield Found(f"motors.{i}.winch_radius_m", f"the winch of cable {motor.cable} is too thick for this robot",
                        f"at most {number(most, 1e3)} mm", f"{number(motor.winch_radius_m, 1e3)} mm")  # fmt: skip
        elif travel < TRAVEL_MIN_S:
            yield Found(f"motors.{i}.no_load_rad_per_s", f"the winch of cable {motor.cable} is too fast: rpm?",
                        f"{number(TRAVEL_MIN_S)} s or more from position 0 to 1", f"{number(travel)} s")  # fmt: skip


@check(
    "warning",
    Robot,
    what="the rest lengths of passive cables and of sensor tendons are below the longest cable of the limits",
    why="a tendon longer than its cable ever gets never pulls; usually its length has another unit",
    fix="correct rest_length_m in {file}, in metres",
)
def rest_lengths_in_limits(robot: Robot) -> Iterator[Found]:
    """Tendons that are always slack."""
    most = robot.limits.cable_length_max_m
    tendons = [("cable", i, cable.rest_length_m) for i, cable in enumerate(robot.cables)]
    tendons += [("sensor", i, sensor.rest_length_m) for i, sensor in enumerate(robot.sensors)]
    for word, i, length in tendons:
        if length is not None and length >= most:
            yield Found(f"{word}s.{i}.rest_length_m", f"the tendon of {word} {i} is always slack",
                        f"below {number(most, 1e3)} mm", f"{number(length, 1e3)} mm")  # fmt: skip


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
    if low < least - ROUNDING_M or high > most + ROUNDING_M:
        yield Found("pid", "the controller asks for lengths outside the limits",
                    f"{number(least, 1e3)} .. {number(most, 1e3)} mm",
                    f"{number(low, 1e3)} .. {number(high, 1e3)} mm")  # fmt: skip


@check(
    "advice",
    Robot,
    what="every sensor is calibrated",
    why="without slope and offset its capacitance says nothing about the length",
    fix="r2s2r calibrate --points points.csv   # lengths and capacitances; of several sets one with --use SET",
)
def sensors_are_calibrated(robot: Robot) -> Iterator[Found]:
    """Sensors without a line."""
    missing = [i for i, sensor in enumerate(robot.sensors) if sensor.slope_f_per_m is None or sensor.offset_f is None]
    if missing:
        yield Found("sensors", "sensors are not calibrated", "slope_f_per_m and offset_f of every sensor",
                    f"none for sensor {', '.join(map(str, missing))}")  # fmt: skip


@check(
    "warning",
    Robot,
    what="the line of every sensor rises, and gives 0.1 pF to 1000 pF over the lengths of the limits",
    why="slope or offset in pF reads every length wrong by many orders of magnitude",
    fix="r2s2r calibrate --points points.csv   # writes both in farads; by hand: 1 pF = 1e-12 F, 1 pF/mm = 1e-9 F/m",
)
def sensor_lines_plausible(robot: Robot) -> Iterator[Found]:
    """Lines of another unit, and lines that fall."""
    low, high = CAPACITANCE_F
    for i, sensor in enumerate(robot.sensors):
        if sensor.slope_f_per_m is None or sensor.offset_f is None:
            continue
        lengths = (robot.limits.cable_length_min_m, robot.limits.cable_length_max_m)
        least, most = (sensor.slope_f_per_m * length + sensor.offset_f for length in lengths)
        if sensor.slope_f_per_m <= 0:
            yield Found(f"sensors.{i}.slope_f_per_m", f"the line of sensor {i} does not rise", "above 0 F/m",
                        f"{number(sensor.slope_f_per_m)} F/m")  # fmt: skip
        elif least < low or most > high:
            yield Found(f"sensors.{i}", f"sensor {i} has a capacitance of another unit",
                        f"{number(low, 1e12)} .. {number(high, 1e12)} pF from the shortest to the longest cable",
                        f"{number(least, 1e12)} .. {number(most, 1e12)} pF")  # fmt: skip

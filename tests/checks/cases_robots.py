"""Robot descriptions with a slip of the keyboard or of the unit, and commands of the wrong sign."""

from __future__ import annotations

from typing import Any

import numpy as np

from r2s2r_cli.checks.subjects import Run
from schemas.robot import Robot
from tests.checks.case import Case, Edge
from tests.support.check_subjects import FRAMES, edited, recording, robot


def _with(table: str, index: int, **changes: Any) -> Robot:
    entries = list(getattr(robot(), table))
    entries[index] = entries[index].model_copy(update=changes)
    return robot().model_copy(update={table: tuple(entries)})


def _part(index: int, **changes: Any) -> Robot:
    parts = list(robot().rods[0].parts)
    parts[index] = parts[index].model_copy(update=changes)
    return _with("rods", 0, parts=tuple(parts))


def scaled(factor: float) -> Robot:
    """The 3-bar robot in another size: lengths by the factor, masses by its cube, the same capacitances."""

    def change(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: change(entry, name) for name, entry in value.items()}
        if isinstance(value, list | tuple):
            return [change(entry, key) for entry in value]
        power = 1 if key.endswith("_m") and "_per_" not in key else 3 if key == "mass_kg" else 0
        power = -1 if key == "slope_f_per_m" else power
        return value if power == 0 or value is None else value * factor**power

    return Robot.model_validate(change(robot().model_dump()))


def _breathing(control: float) -> Run:
    """The whole robot grows and shrinks by 1 % from frame to frame; every cable has `control` while it grows."""
    size = 1 + 0.01 * (np.arange(FRAMES + 1) % 2)
    run = edited(recording(), "caps/p_WE", lambda p: p.__imul__(size[:, None, None]))
    sign = np.where(np.arange(len(run.streams["commands"]["t"])) % 2 == 0, control, -control)
    return edited(run, "commands/control", np.tile(sign[:, None], (1, 6)))


FAILS: tuple[Case, ...] = (
    Case(
        "controls_shorten_cables",
        lambda: _breathing(1.0),
        (
            (
                "runs/a/commands/control",
                "the commands have the wrong sign: they lengthen their cables",
                "a positive correlation of command and shortening (+1 reels in)",
                "-1",
            ),
        ),
    ),
    Case(
        "cables_join_other_caps",
        lambda: _with("cables", 4, caps=tuple(reversed(robot().cables[1].caps))),
        (("cables.4.caps", "cables 1 and 4 join the same end caps", "a pair of caps for each", "caps 1 and 3 twice"),),
    ),
    Case(
        "rod_masses_plausible",
        lambda: _part(2, mass_kg=35.3),
        (
            (
                "rods.0.parts.2.mass_kg",
                "rod 0 (red) is too heavy for its length: grams?",
                "at most 8.582 kg for 325 mm",
                "35.4 kg, of which motor_even 35.3 kg",
            ),
        ),
    ),
    Case(
        "parts_on_their_rod",
        lambda: _part(1, offset_m=1.625),
        (("rods.0.parts.1", "part cap_odd does not lie on rod 0 (red)", "within 198 mm of its middle", "1625 mm"),),
    ),
    Case(
        "winches_plausible",
        lambda: _with("motors", 2, winch_radius_m=0.35),
        (("motors.2.winch_radius_m", "the winch of cable 2 is too thick for this robot", "at most 32.5 mm", "350 mm"),),
    ),
    Case(
        "winches_plausible",
        lambda: _with("motors", 2, no_load_rad_per_s=220.0),
        (
            (
                "motors.2.no_load_rad_per_s",
                "the winch of cable 2 is too fast: rpm?",
                "0.2 s or more from position 0 to 1",
                "0.1623 s",
            ),
        ),
    ),
    Case(
        "rest_lengths_in_limits",
        lambda: _with("cables", 7, rest_length_m=1.65),
        (("cables.7.rest_length_m", "the tendon of cable 7 is always slack", "below 350 mm", "1650 mm"),),
    ),
    Case(
        "rest_lengths_in_limits",
        lambda: _with("sensors", 3, rest_length_m=0.35),
        (("sensors.3.rest_length_m", "the tendon of sensor 3 is always slack", "below 350 mm", "350 mm"),),
    ),
    Case(
        "sensor_lines_plausible",
        lambda: _with("sensors", 3, slope_f_per_m=3e-8),
        (
            (
                "sensors.3",
                "sensor 3 has a capacitance of another unit",
                "0.1 .. 1000 pF from the shortest to the longest cable",
                "1512 .. 1.051e+04 pF",
            ),
        ),
    ),
    Case(
        "sensor_lines_plausible",
        lambda: _with("sensors", 3, slope_f_per_m=-3e-11),
        (("sensors.3.slope_f_per_m", "the line of sensor 3 does not rise", "above 0 F/m", "-3e-11 F/m"),),
    ),
    Case(
        "sites_on_their_caps",
        lambda: _with("cables", 4, sites_m=((0.0, 0.0, -16.25), robot().cables[4].sites_m[1])),
        (
            (
                "cables.4.sites_m.0",
                "cable 4 is attached away from cap 0",
                "at most 26.25 mm from its centre",
                "1.609e+04 mm, which looks like another unit than metres",
            ),
        ),
    ),
)

_ROBOT_CHECKS = (
    "sites_on_their_caps", "rod_masses_plausible", "parts_on_their_rod", "winches_plausible", "rest_lengths_in_limits",
    "sensor_lines_plausible", "cables_join_other_caps", "pid_range_in_limits",
)  # fmt: skip

EDGES: tuple[Edge, ...] = (
    Edge("controls_shorten_cables", "they shorten", lambda: _breathing(-1.0)),
    Edge("controls_shorten_cables", "no command is logged", lambda: _breathing(np.nan)),
    Edge("controls_shorten_cables", "no motor runs", lambda: _breathing(0.0)),
    Edge("pid_range_in_limits", "to the limit, in numbers that binary fractions miss", lambda: _to_the_limit()),
    Edge("rod_masses_plausible", "a heavy rod: 8 kg of lead", lambda: _part(4, mass_kg=8.0)),
    *(Edge(name, "a robot with rods of 1 m", lambda: scaled(1 / 0.325)) for name in _ROBOT_CHECKS),
    *(Edge(name, "a robot with rods of 5 m", lambda: scaled(5 / 0.325)) for name in _ROBOT_CHECKS),
    *(Edge(name, "a robot with rods of 5 cm", lambda: scaled(0.05 / 0.325)) for name in _ROBOT_CHECKS),
)


def _to_the_limit() -> Robot:
    own = robot()
    pid, limits = {"min_length_m": 0.1, "range_m": 0.2}, {"cable_length_max_m": 0.3}
    return own.model_copy(
        update={"pid": own.pid.model_copy(update=pid), "limits": own.limits.model_copy(update=limits)}
    )

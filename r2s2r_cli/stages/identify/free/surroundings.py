"""Entries of the catalogue that belong to the ground, the observation, the controller and the effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.free.actions import Action, Assign, Outside, Place, Slope
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.entry import Element, Entry, Kind, common, each, inside
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine import Structure

STEEPEST = 0.1745
"""[rad] 10 degrees: on more a robot that stands does not stay."""
RESTITUTION_SCALE = 0.3
"""How far from 0 the restitution of a robot that bounces is."""


def ground_entries(robot: Robot) -> list[Entry]:
    """Friction, restitution and lie of the ground."""
    kind = Kind("friction", "1", 20.0, 0.5, 0.1, "Coulomb friction of {} on the ground.", at_least=0.02, at_most=5.0)
    mu = robot.contact.friction
    caps = [Element(f"cap{c}", c, mu, (("friction", c),)) for c in range(robot.n_caps)]
    found = common(kind, caps, "all caps") + each(kind, caps, "cap")
    e = robot.contact.restitution
    found.append(
        Entry(
            Free("restitution", "1", inside(e, 0.0, 1.0, RESTITUTION_SCALE), 0.0, 1.0, Coordinate.LOGIT, 1.5,
                 "Coefficient of restitution of impacts with the ground and between rods."),
            Assign((("restitution", 0),)), e, "restitution",
        )
    )  # fmt: skip
    for name, axis in (("ground_slope_y", 1), ("ground_slope_x", 0)):
        free = Free(name, "rad", 0.0, -STEEPEST, STEEPEST, Coordinate.LINEAR, 0.02,
                    f"Rotation of the ground about the world's {'xy'[axis]} axis.")  # fmt: skip
        found.append(Entry(free, Slope(axis), 0.0, name))
    return found


def observation_entries() -> list[Entry]:
    """What lies between the simulated robot and what the camera sees."""
    rows = (
        ("ground_height", "m", 0.0, -0.05, 0.05, 0.005, "Height of the observed end caps over the simulated ones."),
        (
            "command_delay",
            "s",
            0.0,
            0.0,
            0.5,
            0.03,
            "Time from a motor command in the log to its arrival at the winch.",
        ),
        ("camera_delay", "s", 0.0, -0.2, 0.5, 0.03, "Time by which an observed frame is older than its time stamp."),
    )
    return [
        Entry(
            Free(name, unit, inside(nominal, lower, upper, sd), lower, upper, Coordinate.LINEAR, sd, what),
            Outside("observation", name), nominal, name,
        )
        for name, unit, nominal, lower, upper, sd, what in rows
    ]  # fmt: skip


def pid_entries(robot: Robot) -> list[Entry]:
    """The low-level controller; read in closed loop only."""
    pid = robot.pid
    rows = (
        ("p", "1", pid.p, 10.0, 0.5, 1.0, np.inf, "Proportional gain of the controller."),
        ("i", "1", pid.i, 100.0, 1.0, 0.01, np.inf, "Integral gain of the controller, a tick."),
        ("d", "1", pid.d, 20.0, 1.0, 0.1, np.inf, "Differential gain of the controller, a tick."),
        ("tolerance", "1", pid.tolerance, 10.0, 0.3, 0.1, 1.0, "Share of the range within which a cable is done."),
        ("min_length", "m", pid.min_length_m, 3.0, 0.1, 0.1, np.inf, "Cap distance at position 0."),
        ("range", "m", pid.range_m, 3.0, 0.1, 0.1, np.inf, "Cap distance from position 0 to position 1."),
    )
    found = []
    for key, unit, nominal, factor, sd, scale, at_most, what in rows:
        kind = Kind(f"pid_{key}", unit, factor, sd, scale, what, at_most=at_most)
        (entry,) = common(kind, [Element(key, 0, nominal, ())], "")
        found.append(Entry(entry.free, Outside("pid", key), nominal, entry.family))
    return found


def effect_entries(robot: Robot) -> list[Entry]:
    """Every number of every effect: EFFECT.PARAMETER for all its elements, EFFECT.PARAMETER.K for one."""
    from r2s2r_cli.stages.effects import all_effects
    from r2s2r_cli.stages.model import structure_of

    structure = structure_of(robot)
    found = []
    for effect in all_effects():
        for own in (one for one in effect.own if one.fitted):
            family, count = f"{effect.name}.{own.name}", own.count(structure)
            begun = own.off if own.start is None else own.start
            start = inside(begun, own.lower, own.upper, own.scale)
            parts = list(robot.actuated) if own.per == "actuated" else list(range(count))
            elements: list[tuple[int | None, tuple[Place, ...]]] = [(None, tuple((family, i) for i in range(count)))]
            if own.per != "robot":
                elements += [(k, ((family, i),)) for i, k in enumerate(parts)]
            for number, places in elements:
                name = family if number is None else f"{family}.{number}"
                where = "" if own.per == "robot" else f" ({_part(own.per, number)})"
                what = f"Effect {effect.title}: {own.what}{where}."
                free = Free(
                    name, own.unit, start, own.lower, own.upper, Coordinate.LINEAR, own.scale, what, own.off,
                    own.only_shape,
                )  # fmt: skip
                action: Action = Assign(places)
                if name in DELAYS:
                    action = Outside("observation", DELAYS[name], added=name)
                found.append(
                    Entry(free, action, own.off, family, number, effect=effect.name, alike=_alike(name, structure))
                )
    return found


DELAYS = {"command_latency.tau_s": "command_delay", "camera_delay.tau_s": "camera_delay"}
"""Numbers of effects that shift the log in time instead of being read by the step, and what they are added to."""


def _part(per: str, number: int | None) -> str:
    part = {"actuated": "winched cable", "sensor": "cable sensor"}.get(per, per)
    return f"one number for every {part}" if number is None else f"{part} {number}"


def _alike(name: str, structure: Structure) -> frozenset[Place]:
    """What an effect's number adds to that a number of the robot sets."""
    winches, caps = range(structure.n_actuated), range(2 * structure.n_rods)
    if name in DELAYS:
        return frozenset({(f"observation.{DELAYS[name]}", 0)})
    if name in ("ground_slope.angle_x_rad", "ground_slope.angle_y_rad"):
        return frozenset({("gravity", 0 if "_x_" in name else 1)})
    whole: dict[str, list[Place]] = {
        "motor_lag.tau_s": [("lag", k) for k in winches],
        "load_droop.per_newton": [("droop", k) for k in winches],
        "motor_speed_mismatch.factor": [(field, k) for field in ("speed_in", "speed_out") for k in winches],
        "cap_friction.factor": [("friction", k) for k in caps],
        "tendon_stiffness.factor": [("stiffness", k) for k in range(structure.n_cables)],
    }
    return frozenset(whole.get(name, ()))

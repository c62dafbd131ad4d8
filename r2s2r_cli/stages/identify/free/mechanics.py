"""Entries of the catalogue that belong to motors, cables and rods."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.calibrate.masses import mass_properties
from r2s2r_cli.stages.identify.free.actions import AttachmentPhase, CentreOfMass, Shift
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.entry import Element, Entry, Kind, common, each, mean
from schemas.robot import Robot

SPEED_WHAT = "Speed of {} at full command without load, as a share of the no-load speed of robot.toml"


def motor_entries(robot: Robot) -> list[Entry]:
    """Speeds, lag and droop of the winches; K is the number of the winched cable."""
    motors = sorted(robot.motors, key=lambda motor: motor.cable)
    found: list[Entry] = []
    for name, fields, way in (
        ("motor_speed", ("speed_in", "speed_out"), ", both ways"),
        ("motor_speed_in", ("speed_in",), ", reeling in"),
        ("motor_speed_out", ("speed_out",), ", paying out"),
    ):
        kind = Kind(name, "1", 5.0, 0.3, 0.1, SPEED_WHAT + way + ".")
        found += _both(
            kind,
            [
                Element(str(motor.cable), motor.cable, motor.speed, tuple((field, k) for field in fields))
                for k, motor in enumerate(motors)
            ],
            "winch",
        )
    lag = Kind("motor_lag", "s", 1.0, np.inf, 0.05, "Time constant of the first-order lag of {}.", law="lag")
    droop = Kind("load_droop", "1/N", 1.0, np.inf, 0.02, "Relative loss of speed of {} per newton, reeling in.",
                 law="droop")  # fmt: skip
    for kind, field in ((lag, "lag"), (droop, "droop")):
        elements = [Element(str(m.cable), m.cable, 0.0, ((field, k),)) for k, m in enumerate(motors)]
        found += _both(kind, elements, "winch")
    return found


def cable_entries(robot: Robot) -> list[Entry]:
    """Stiffness, damping and rest length of the cables, stiffness of sensor tendons; K is the number of the cable."""
    stiffness = Kind("stiffness", "N/m", 20.0, 0.5, 10.0,
                     "Stiffness of {} (all coefficients of a cubic law in proportion).")  # fmt: skip
    damping = Kind("damping", "N s/m", 20.0, 1.0, 1.0, "Damping of {} while taut.")
    tendon = Kind("tendon_stiffness", "N/m", 10.0, 0.5, 1.0, "Stiffness of the sensor tendon beside {}.")
    laws = ("stiffness", "stiffness2", "stiffness3")
    springs, dampers = [], []
    for k, cable in enumerate(robot.cables):
        springs.append(Element(str(k), k, cable.stiffness_n_per_m, tuple((law, k) for law in laws)))
        dampers.append(Element(str(k), k, cable.damping_n_s_per_m, (("damping", k),)))
    winched = set(robot.actuated)
    found = common(damping, dampers, "all cables")
    for group, part in (("actuated", "the winched cables"), ("passive", "the passive cables")):
        members = [k for k in range(len(robot.cables)) if (k in winched) == (group == "actuated")]
        found += common(_named(stiffness, f"stiffness_{group}"), [springs[k] for k in members], part)
        found += common(_named(damping, f"damping_{group}"), [dampers[k] for k in members], part)
    found += each(stiffness, springs, "cable")
    found += each(damping, dampers, "cable")
    beside = sorted((s for s in robot.sensors if s.stiffness_n_per_m > 0), key=lambda sensor: sensor.cable)
    tendons = [Element(str(s.cable), s.cable, s.stiffness_n_per_m, (("tendon_stiffness", s.cable),)) for s in beside]
    found += common(tendon, tendons, "every winched cable") + each(tendon, tendons, "cable")
    return found + _rest_lengths(robot)


def rod_entries(robot: Robot) -> list[Entry]:
    """Masses, centres of mass and attachment phases; R is the number of the rod, 0 for caps 0 and 1."""
    bodies = [mass_properties(rod.parts) for rod in robot.rods]
    kind = Kind("mass", "kg", 5.0, 0.1, 0.1, "Mass of {}; its inertia goes with it.")
    elements = [
        Element(str(r), r, body.mass, (("mass", r), *(("inertia", 9 * r + k) for k in range(9))))
        for r, body in enumerate(bodies)
    ]
    found = common(kind, elements, "each rod") + each(kind, elements, "rod")
    ends = [[2 * k + side for k, cable in enumerate(robot.cables) for side in range(2) if cable.caps[side] // 2 == r]
            for r in range(len(robot.rods))]  # fmt: skip
    for r, (rod, body) in enumerate(zip(robot.rods, bodies, strict=True)):
        far = rod.length_m / 4
        free = Free(
            f"com.{r}", "m", body.com, body.com - far, body.com + far, Coordinate.LINEAR, 0.01,
            f"Centre of mass of rod {r} along its axis, from the middle between its caps towards the odd cap.",
        )  # fmt: skip
        found.append(Entry(free, CentreOfMass(r, tuple(ends[r]), body.com), body.com, "com", r))
    for r in range(len(robot.rods)):
        if ends[r]:
            free = Free(
                f"attachment_phase.{r}", "rad", 0.0, -np.pi, np.pi, Coordinate.LINEAR, 0.5,
                f"Rotation of all attachment points of rod {r} about its axis, right-handed towards the odd cap.",
            )  # fmt: skip
            found.append(Entry(free, AttachmentPhase(r, tuple(ends[r])), 0.0, "attachment_phase", r))
    return found


def _rest_lengths(robot: Robot) -> list[Entry]:
    """One number moves all passive cables by the same length; or one number a cable."""
    passive = [k for k in range(len(robot.cables)) if k not in robot.actuated]
    own = [float(robot.cables[k].rest_length_m or 0.0) for k in passive]
    if not passive:
        return []
    found, shown, room = [], mean(own), min(own) / 2
    what = "Rest length of the passive cables between attachment points: their mean; all move by the same length."
    free = Free("rest_length", "m", shown, shown - room, shown + room, Coordinate.LINEAR, 0.01, what)
    found.append(Entry(free, Shift(tuple(("rest", i) for i in range(len(passive))), shown), shown, "rest_length"))
    for i, (k, length) in enumerate(zip(passive, own, strict=True)):
        what = f"Rest length of passive cable {k} between its attachment points."
        free = Free(f"rest_length.{k}", "m", length, length / 2, 1.5 * length, Coordinate.LINEAR, 0.01, what)
        found.append(Entry(free, Shift((("rest", i),), length), length, "rest_length", k))
    return found


def _both(kind: Kind, elements: list[Element], part: str) -> list[Entry]:
    return common(kind, elements, f"all {part}es") + each(kind, elements, part)


def _named(kind: Kind, name: str) -> Kind:
    from dataclasses import replace

    return replace(kind, name=name)

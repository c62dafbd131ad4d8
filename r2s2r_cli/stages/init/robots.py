"""`robot.toml` as text: one of the known robots, with the source of every number beside it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest
from r2s2r_cli.stages.init.attachment import Mode, attach
from r2s2r_cli.stages.init.facts import FACTS, HSV_SOURCE, LEGEND, SATURATION_MIN, VALUE_MIN
from r2s2r_cli.stages.init.robot_facts import Fact, Part, RobotFacts

_DECIMALS = 6
"""Derived points are written to the micrometre, far below what anyone can measure on the robot."""


def robot_facts(name: str) -> RobotFacts:
    """The numbers of one robot. Raises UsageError for an unknown name, with the nearest known one."""
    if name not in FACTS:
        near = nearest(name, FACTS) or next(iter(FACTS))
        raise UsageError(
            f"unknown robot {name!r}",
            where="--robot",
            expected=", ".join(FACTS),
            received=name,
            hint=f"--robot {near}",
        )
    return FACTS[name]


def robot_toml(name: str, attachment: Mode = "surface") -> str:
    """The text of `robot.toml` for one robot; loads as schemas.robot.Robot.

    attachment: `surface`, the paper's heuristic, or `rod_end`, NTRT's (see attachment.attach).
    Raises UsageError for an unknown robot or attachment.
    """
    facts = robot_facts(name)
    # What people edit most comes first; TOML wants the keys without a table before all tables.
    lines = [*_head(facts, attachment), *_controller(facts), *_rods(facts), *_cables(facts, attachment)]
    lines += _motors(facts)
    if facts.sensors:
        lines += _sensors(facts)
    if facts.colors:
        lines += _colors(facts)
    return "\n".join(lines) + "\n"


def _line(key: str, value: object, source: str = "") -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else f"{value}"
    return f"{key} = {text}" + (f"  # {source}" if source else "")


def _fact(key: str, fact: Fact, first: bool = True) -> str:
    """A number; its source only in the first table of a kind, as the head of the file says."""
    return _line(key, fact.value, fact.source if first else "")


def _point(p: np.ndarray) -> str:
    rounded = np.round(p, _DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0
    return "[" + ", ".join(f"{x: .{_DECIMALS}f}" for x in rounded) + "]"


def _head(facts: RobotFacts, attachment: str) -> Iterator[str]:
    yield f"# robot.toml: {facts.title}."
    for about in facts.about:
        yield f"# {about}"
    yield "# SI units. Edit it by hand; `r2s2r calibrate` changes single values and keeps the comments."
    yield "# A number without a comment has the source that stands in the first table of its kind."
    yield "#"
    for legend in LEGEND:
        yield f"# {legend}"
    yield ""
    yield "schema_version = 1"
    yield _line("name", facts.name)
    yield _line("title", facts.title)
    yield _line("illustrative", facts.illustrative)
    yield _line("attachment", attachment, 'of the sites below: "surface" of the caps [P], or "rod_end"')
    edge = f"actuated cables at {facts.rest_edge:g} m (min_length_m + range_m)"
    shape = "the prism twisted by 150 degrees" if len(facts.rods) == 3 else "the icosahedron-like shape"
    yield ""
    yield f"# Caps at rest in the world, z up. Derived: {shape},"
    yield f"# {edge}, lying on caps {', '.join(map(str, facts.support))}."
    yield "rest_caps_m = ["
    for cap, p in enumerate(facts.rest_caps()):
        yield f"  {_point(p)},  # cap {cap}"
    yield "]"


def _controller(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield "# Low-level controller: position = (cap distance - min_length_m) / range_m, 0 short to 1 long."
    yield "[pid]"
    for key, fact in (
        ("p", facts.p), ("i", facts.i), ("d", facts.d), ("tolerance", facts.tolerance),
        ("min_length_m", facts.min_length), ("range_m", facts.range), ("rate_hz", facts.rate),
        ("step_timeout_s", facts.step_timeout),
    ):  # fmt: skip
        yield _fact(key, fact)
    yield ""
    yield "# What a healthy robot never leaves, between cap centres: outside, `validate` complains and the host stops."
    yield "[limits]"
    yield _fact("cable_length_min_m", facts.cable_length_min)
    yield _fact("cable_length_max_m", facts.cable_length_max)
    yield _fact("cap_height_max_m", facts.cap_height_max)
    yield ""
    yield "# Where identification starts, not a truth."
    yield "[contact]"
    yield _fact("friction", facts.friction)
    yield _fact("restitution", facts.restitution)


def _rods(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield f"# Rods, {facts.rod_mass.value:g} kg each {facts.rod_mass.source}."
    yield "# offset_m of a part: along the rod from its middle, positive towards the odd cap."
    for i, (rod, caps) in enumerate(facts.rods):
        if i:
            yield ""
        yield "[[rods]]"
        yield _line("name", rod, caps)
        yield _fact("length_m", facts.rod_length, not i)
        yield _fact("radius_m", facts.rod_radius, not i)
        yield _fact("cap_radius_m", facts.cap_radius, not i)
        for part in facts.parts:
            for side in (-1, 1) if part.pair else (0,):
                yield from _part(part, side, first=not i and side < 1)


def _part(part: Part, side: int, *, first: bool) -> Iterator[str]:
    yield "  [[rods.parts]]"
    yield "  " + _line("name", part.name + {-1: "_even", 0: "", 1: "_odd"}[side])
    yield "  " + _line("shape", part.shape)
    yield "  " + _fact("mass_kg", part.mass, first)
    yield "  " + _line("offset_m", part.offset.value * (side or 1), part.offset.source if first else "")
    yield "  " + _fact("radius_m", part.radius, first)
    if part.length is not None:
        yield "  " + _fact("length_m", part.length, first)
    if part.inner_radius is not None:
        yield "  " + _fact("inner_radius_m", part.inner_radius, first)


def _cables(facts: RobotFacts, attachment: Mode) -> Iterator[str]:
    sites = attach(facts.rest_caps(), facts.cables, facts.cap_radius.value, attachment, guides=facts.guides).sites
    how = "derived: points A to H [P]" if attachment == "surface" else "derived: cap centres"
    n = len(facts.actuated)
    yield ""
    yield f"# Cables, in the order of their numbers: 0 to {n - 1} winched, the others passive."
    yield "# sites_m: where the cable is tied, one point a cap, in the frame of that cap's rod at rest: origin in its"
    yield "# middle, z towards the odd cap, x perpendicular to the rod and most upwards (docs/concepts/attachment.md)."
    for k, (a, b) in enumerate(facts.cables):
        winched, first = k < n, k in (0, n)
        if k:
            yield ""
        yield f"[[cables]]  # cable {k}"
        yield f"caps = [{a}, {b}]" + (f"  # {facts.cables_source}" if first else "")
        yield _line("kind", "actuated" if winched else "passive")
        yield _fact("stiffness_n_per_m", facts.actuated_stiffness if winched else facts.passive_stiffness, first)
        yield _fact("damping_n_s_per_m", facts.actuated_damping if winched else facts.passive_damping, first)
        if not winched:
            for power in (2, 3):
                note = "assumption: linear until calibrated, [P] gives no coefficients" if first else ""
                yield _line(f"stiffness{power}_n_per_m{power}", 0.0, note)
            yield _fact("rest_length_m", facts.passive_rest_length, first)
        yield f"sites_m = [{', '.join(map(_point, sites[k]))}]" + (f"  # {how}" if first else "")


def _motors(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield "# Winches, one a winched cable. sign: of the wire command that reels in."
    for k, motor in enumerate(facts.motors):
        if k:
            yield ""
        yield f"[[motors]]  # winch of cable {k}"
        yield _line("cable", k)
        yield _fact("no_load_rad_per_s", facts.no_load, not k)
        yield _fact("speed", facts.speed, not k)
        yield _fact("winch_radius_m", facts.winch_radius, not k)
        if motor.board:
            yield _line("board", motor.board, "" if k else facts.board_source)
        yield _line("sign", motor.sign, "" if k else facts.sign_source)


def _sensors(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield "# Stretch sensors, sensor i on cable i [H]. Capacitance in farad = slope_f_per_m length + offset_f;"
    yield "# `r2s2r calibrate` writes both. Until then the sensors are not calibrated."
    for k, (a, b) in enumerate(facts.cables):
        if k:
            yield ""
        yield f"[[sensors]]  # sensor {k}, caps {a} and {b}"
        yield _line("cable", k)
        if k == 0:
            note = "assumption: its own tendon left out"
        else:
            note = "[P] the passive tendon is the sensor" if k == len(facts.actuated) else ""
        yield _line("stiffness_n_per_m", 0.0, note)


def _colors(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield "# Colours of the rods' caps in the camera's picture."
    for i, color in enumerate(facts.colors):
        if i:
            yield ""
        yield "[[colors]]"
        yield _line("rod", color.rod)
        yield f"hue = [{color.hue[0]}, {color.hue[1]}]" + ("" if i else f"  # {HSV_SOURCE}")
        yield _fact("saturation_min", SATURATION_MIN, not i)
        yield _fact("value_min", VALUE_MIN, not i)

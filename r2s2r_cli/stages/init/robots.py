"""`robot.toml` as text: one of the known robots, with the source of every number beside it."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.init.attachment import Mode, attach
from r2s2r_cli.stages.init.facts import (
    FACTS,
    HSV_SOURCE,
    LEGEND,
    SATURATION_MIN,
    VALUE_MIN,
    Fact,
    Part,
    RobotFacts,
)

ROBOTS: dict[str, str] = {name: facts.title for name, facts in FACTS.items()}
"""Name and one-line title of every robot that `init` knows."""

_DECIMALS = 6
"""Derived points are written to the micrometre, far below what anyone can measure on the robot."""


def robot_facts(name: str) -> RobotFacts:
    """The numbers of one robot. Raises UsageError for an unknown name, with the nearest known one."""
    if name not in FACTS:
        near = difflib.get_close_matches(name, FACTS, n=1, cutoff=0.0)[0]
        raise UsageError(
            f"unknown robot {name!r}",
            where="--robot",
            expected=", ".join(FACTS),
            received=name,
            hint=f"r2s2r init --robot {near}",
        )
    return FACTS[name]


def robot_toml(name: str, attachment: Mode = "surface") -> str:
    """The text of `robot.toml` for one robot; loads as schemas.robot.Robot.

    attachment: `surface`, the paper's heuristic, or `rod_end`, NTRT's (see attachment.attach).
    Raises UsageError for an unknown robot or attachment.
    """
    facts = robot_facts(name)
    return "\n".join([*_head(facts, attachment), *_rods(facts), *_cables(facts, attachment), *_drives(facts)]) + "\n"


def _line(key: str, value: object, source: str = "") -> str:
    if isinstance(value, Fact):
        source, value = source or value.source, value.value
    text = f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else f"{value}"
    return f"{key} = {text}" + (f"  # {source}" if source else "")


def _point(p: np.ndarray) -> str:
    rounded = np.round(p, _DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0
    return "[" + ", ".join(f"{x:.{_DECIMALS}f}" for x in rounded) + "]"


def _head(facts: RobotFacts, attachment: str) -> Iterator[str]:
    yield f"# robot.toml: {facts.title}."
    for about in facts.about:
        yield f"# {about}"
    yield "# SI units throughout. Edit it by hand; `r2s2r calibrate` changes single values and keeps the comments."
    yield "#"
    yield "# Sources:"
    for legend in LEGEND:
        yield f"# {legend}"
    yield "# derived: computed by `r2s2r init` from the other numbers;  assumption: nobody has published it."
    yield ""
    yield "schema_version = 1"
    yield _line("name", facts.name)
    yield _line("title", facts.title)
    yield _line("illustrative", facts.illustrative)
    yield _line("attachment", attachment, "`surface` of the caps [P System Identification], or `rod_end` (NTRT)")
    edge = f"its actuated edges {facts.rest_edge * 1e3:g} mm (min_length_m + range_m)"
    shape = "prism of 150 degrees twist" if len(facts.rods) == 3 else "icosahedron-like shape"
    yield ""
    yield f"# Rest pose, world frame W, z up, lying on caps {list(facts.support)}: derived, the {shape},"
    yield f"# {edge}."
    yield "# The sites below refer to the rod frames of this pose: x most upwards, z towards the odd cap."
    yield "rest_caps_m = ["
    for cap, p in enumerate(facts.rest_caps()):
        yield f"  {_point(p)},  # derived: cap {cap}"
    yield "]"


def _rods(facts: RobotFacts) -> Iterator[str]:
    for i, (rod, source) in enumerate(facts.rods):
        as_first = f"as rod {facts.rods[0][0]}" if i else ""
        yield ""
        yield "[[rods]]"
        yield _line("name", rod, source)
        yield _line("length_m", facts.rod_length, as_first)
        yield _line("radius_m", facts.rod_radius, as_first)
        yield _line("cap_radius_m", facts.cap_radius, as_first)
        for part in facts.parts:
            for side in (-1, 1) if part.pair else (0,):
                yield from _part(part, side, as_first)
        if not i:
            yield f"# together {facts.rod_mass.value * 1e3:.1f} g a rod: {facts.rod_mass.source}"


def _part(part: Part, side: int, as_first: str) -> Iterator[str]:
    yield "  [[rods.parts]]"
    yield "  " + _line("name", part.name + {-1: "_even", 0: "", 1: "_odd"}[side])
    yield "  " + _line("shape", part.shape)
    yield "  " + _line("mass_kg", part.mass, as_first)
    yield "  " + _line("offset_m", part.offset.value * (side or 1), as_first or part.offset.source)
    yield "  " + _line("radius_m", part.radius, as_first)
    if part.length is not None:
        yield "  " + _line("length_m", part.length, as_first)
    if part.inner_radius is not None:
        yield "  " + _line("inner_radius_m", part.inner_radius, as_first)


def _cables(facts: RobotFacts, attachment: Mode) -> Iterator[str]:
    sites = attach(facts.rest_caps(), facts.cables, facts.cap_radius.value, attachment, guides=facts.guides).sites
    how = "points A..H of [P System Identification]" if attachment == "surface" else "cap centres, NTRT's rod end nodes"
    n = len(facts.actuated)
    yield ""
    yield f"# Cables, in the order of their numbers: 0..{n - 1} winched, the others passive. Sites: derived, {how}."
    for k, (a, b) in enumerate(facts.cables):
        winched = k < n
        as_first = "" if k in (0, n) else f"as cable {0 if winched else n}"
        yield ""
        yield f"[[cables]]  # cable {k}"
        yield f"caps = [{a}, {b}]  # {facts.cables_source}"
        yield _line("kind", "actuated" if winched else "passive")
        yield _line("stiffness_n_per_m", facts.actuated_stiffness if winched else facts.passive_stiffness, as_first)
        yield _line("damping_n_s_per_m", facts.actuated_damping if winched else facts.passive_damping, as_first)
        if not winched:
            note = as_first or "not published ([P] measured a cubic, without its numbers): linear until calibrated"
            yield _line("stiffness2_n_per_m2", 0.0, note)
            yield _line("stiffness3_n_per_m3", 0.0, note)
            yield _line("rest_length_m", facts.passive_rest_length, as_first)
        yield "sites_m = ["
        for cap, site in zip((a, b), sites[k], strict=True):
            yield f"  {_point(site)},  # derived: on cap {cap}, frame of rod {facts.rods[cap // 2][0]}"
        yield "]"


def _drives(facts: RobotFacts) -> Iterator[str]:
    for k, motor in enumerate(facts.motors):
        as_first = "as cable 0" if k else ""
        yield ""
        yield f"[[motors]]  # winch of cable {k}"
        yield _line("cable", k)
        yield _line("no_load_rad_per_s", facts.no_load, as_first)
        yield _line("speed", facts.speed, as_first)
        yield _line("winch_radius_m", facts.winch_radius, as_first)
        if motor.board:
            yield _line("board", motor.board, facts.board_source)
        yield _line("sign", motor.sign, facts.sign_source)
    if facts.sensors:
        yield from _sensors(facts)
    yield ""
    yield "# Low-level controller: position = (cap distance - min_length_m) / range_m, 0 short .. 1 long."
    yield "[pid]"
    for key, fact in (
        ("p", facts.p), ("i", facts.i), ("d", facts.d), ("tolerance", facts.tolerance),
        ("min_length_m", facts.min_length), ("range_m", facts.range), ("rate_hz", facts.rate),
        ("step_timeout_s", facts.step_timeout),
    ):  # fmt: skip
        yield _line(key, fact)
    yield ""
    yield "[limits]  # between cap centres; outside them `validate` complains and the host stops"
    yield _line("cable_length_min_m", facts.cable_length_min)
    yield _line("cable_length_max_m", facts.cable_length_max)
    yield _line("cap_height_max_m", facts.cap_height_max)
    yield ""
    yield "[contact]  # where identification starts, not a truth"
    yield _line("friction", facts.friction)
    yield _line("restitution", facts.restitution)
    for color in facts.colors:
        yield ""
        yield "[[colors]]"
        yield _line("rod", color.rod)
        yield f"hue = [{color.hue[0]}, {color.hue[1]}]  # {HSV_SOURCE}"
        yield _line("saturation_min", SATURATION_MIN)
        yield _line("value_min", VALUE_MIN)


def _sensors(facts: RobotFacts) -> Iterator[str]:
    yield ""
    yield "# Stretch sensors, sensor i on cable i ([R3] and the authors' sensor list). Not calibrated yet:"
    yield "# `r2s2r calibrate` writes slope_f_per_m and offset_f (capacitance [F] = slope length + offset)."
    for k, (a, b) in enumerate(facts.cables):
        yield ""
        yield f"[[sensors]]  # sensor {k}, caps {a}-{b}"
        yield _line("cable", k)
        if k < len(facts.actuated):
            note = "as sensor 0" if k else (
                "assumption: left out; a published variant [R2] has 100 N/m beyond 140-175 mm"
            )  # fmt: skip
            yield _line("stiffness_n_per_m", 0.0, note)
        else:
            yield _line(
                "stiffness_n_per_m", 0.0, "[P Offline Robot Measurements]: the passive tendon is itself a sensor"
            )

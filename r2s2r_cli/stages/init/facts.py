"""The robots' numbers, each with its source. `toml.py` writes them down, sites and rest pose are derived."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from r2s2r_cli.stages.init.prism import PRISM_CABLES, PRISM_SUPPORT, prism_rest
from r2s2r_cli.stages.init.sixbar import EDGE_PER_ROD, sixbar_cables, sixbar_rest, sixbar_support


class Fact(NamedTuple):
    """A value in SI and where it comes from, as it will stand in a comment. Sources are abbreviated as in LEGEND."""

    value: float
    source: str


LEGEND = (
    "[R1] the authors' public simulator, nchen9191/tensegrity_diff_physics_public: its controller and bodies",
    "[R2] its configurations 3_bar_tensegrity*.json and identified contact sets (r2s2r reference robot.md, section 2)",
    "[R3] the robot's host and firmware, ChemStud24/tensegrity (robot.md, section 3)",
    "[P]  the seed paper, section named   [C] the published crawl of the 360 mm robot, 2023-02-21",
    "[V]  the authors' tracker, shiyoung77/tensegrity_perception (perception.md, section 1)",
    "[E]  own measurements of step size and stiffness (contact.md, engines.md)",
)


class Part(NamedTuple):
    """One lump of a rod; offset along the rod, mirrored where `pair`."""

    name: str
    pair: bool
    shape: str
    mass: Fact
    offset: Fact
    radius: Fact
    length: Fact | None = None
    inner_radius: Fact | None = None


class HsvFact(NamedTuple):
    """Colour range of one rod."""

    rod: str
    hue: tuple[int, int]


class MotorFact(NamedTuple):
    """Wiring of one winch: cable number is its place in the list."""

    board: str
    sign: int


@dataclass(frozen=True)
class RobotFacts:
    """Everything about one robot that is not derived."""

    name: str
    title: str
    about: tuple[str, ...]
    illustrative: bool
    rods: tuple[tuple[str, str], ...]
    """(name, source of it)"""
    rod_length: Fact
    rod_radius: Fact
    cap_radius: Fact
    parts: tuple[Part, ...]
    rod_mass: Fact
    """What the parts must add up to."""
    actuated: tuple[tuple[int, int], ...]
    passive: tuple[tuple[int, int], ...]
    support: tuple[int, int, int]
    cables_source: str
    actuated_stiffness: Fact
    actuated_damping: Fact
    passive_stiffness: Fact
    passive_damping: Fact
    passive_rest_length: Fact
    motors: tuple[MotorFact, ...]
    board_source: str
    sign_source: str
    no_load: Fact
    speed: Fact
    winch_radius: Fact
    sensors: bool
    p: Fact
    i: Fact
    d: Fact
    tolerance: Fact
    min_length: Fact
    range: Fact
    rate: Fact
    step_timeout: Fact
    cable_length_min: Fact
    cable_length_max: Fact
    cap_height_max: Fact
    friction: Fact
    restitution: Fact
    colors: tuple[HsvFact, ...]

    @property
    def cables(self) -> tuple[tuple[int, int], ...]:
        """All cables, actuated first."""
        return self.actuated + self.passive

    @property
    def guides(self) -> tuple[int, ...]:
        """The passive tendons: they turn the outer rods in the attachment heuristic."""
        return tuple(range(len(self.actuated), len(self.cables)))

    @property
    def rest_edge(self) -> float:
        """Cap distance of a fully extended actuated cable [m]."""
        return self.min_length.value + self.range.value

    def rest_caps(self) -> np.ndarray:
        """End caps at rest p_WE [m], shape (cap, 3)."""
        if self.support == PRISM_SUPPORT and len(self.rods) == 3:
            return prism_rest(self.rod_length.value, self.rest_edge, self.cap_radius.value)
        return sixbar_rest(self.rod_length.value, self.cap_radius.value)


_RODS = (
    ("red", "end caps 0, 1 [R2]"),
    ("green", "end caps 2, 3 [R2]"),
    ("blue", "end caps 4, 5 [R2]"),
)
_ROD_RADIUS = Fact(0.0016, "[R2] 1.6 mm")
_CAP_RADIUS = Fact(0.0175, "[R2] 17.5 mm")
_HUES = (HsvFact("red", (165, 180)), HsvFact("green", (60, 78)), HsvFact("blue", (103, 120)))
HSV_SOURCE = "[V] hue range in 8-bit OpenCV units (0..180)"
SATURATION_MIN = Fact(100, "[V] S >= 100")
VALUE_MIN = Fact(25, "[V] V >= 25-30, the lower one keeps more of a shaded cap")

THREEBAR = RobotFacts(
    name="threebar",
    title="untethered 3-bar prismatic tensegrity, 36 cm rods: the robot of the paper",
    about=("The robot of the paper. Its configuration is v1 (Yale) of the authors' simulator where they differ.",),
    illustrative=False,
    rods=_RODS,
    rod_length=Fact(0.325, "[R2] cap centre to cap centre; 0.360 tip to tip, as in [P]"),
    rod_radius=_ROD_RADIUS,
    cap_radius=_CAP_RADIUS,
    parts=(
        Part("cap", True, "sphere", Fact(0.0105, "[R2] 10.5 g each"),
             Fact(0.1625, "derived: half the rod length"), _CAP_RADIUS),
        Part("motor", True, "tube", Fact(0.0353, "[R2] 35.3 g each"),
             Fact(0.1175, "[R2] 117.5 mm (v1; 102.5 mm on v2)"), Fact(0.0175, "[R2] 17.5 mm"),
             Fact(0.045, "[R2] 45 mm"), Fact(0.0016, "assumption: hollow [R1], the rod (1.6 mm) runs through it")),
        Part("rod", False, "cylinder", Fact(0.0418, "[R2] 41.8 g with electronics (bare rod 3.8 g)"),
             Fact(0.0, "assumption: centred"), Fact(0.0016, "[R2] 1.6 mm"),
             Fact(0.325, "assumption, as in the authors' model: electronics spread along the rod")),
    ),
    rod_mass=Fact(0.1334, "[R2] 133.4 g"),
    actuated=PRISM_CABLES[:6],
    passive=PRISM_CABLES[6:],
    support=PRISM_SUPPORT,
    cables_source="[R2] cable numbers, the same everywhere",
    actuated_stiffness=Fact(2000.0, "assumption: inelastic [P Offline Robot Measurements]; [R2] 1000 N/m rescaled "
                                    "to true g, doubled: 4 N stretch it 2 mm [E]"),
    actuated_damping=Fact(4.0, "assumption, with that stiffness [E]; [R2] 1 N s/m as written"),
    passive_stiffness=Fact(100.0, "[R2] 10000 g/s^2 in the file, 100 N/m rescaled to true g"),
    passive_damping=Fact(1.0, "[R2] 1000 g/s in the file, as written"),
    passive_rest_length=Fact(0.165, "[R2] 165 mm (v1; 170 mm on v2)"),
    motors=tuple(MotorFact("central", 1) for _ in range(6)),
    board_source="[R3] one BLE central takes `d <1..6> <speed>`",
    sign_source="assumption: [R3] positive speed shortens, no sign vector is published for this robot",
    no_load=Fact(23.038, "[R2] 220 rpm, no load (2 pi 220 / 60)"),
    speed=Fact(0.8, "[C] 0.8; [R2] 0.7-0.8"),
    winch_radius=Fact(0.0035, "[R2] and [C] 3.5 mm"),
    sensors=True,
    p=Fact(6.0, "[R3] max_speed 99 robot: P 6"),
    i=Fact(0.01, "[R3] I .01"),
    d=Fact(0.5, "[R3] D .5"),
    tolerance=Fact(0.12, "[R3] tol .12 (the crawl ran with 0.1 [C])"),
    min_length=Fact(0.095, "[C] 95 mm, between cap centres"),
    range=Fact(0.1, "[C] 100 mm"),
    rate=Fact(50.0, "[R3] control runs at the sensor rate, about 50 Hz"),
    step_timeout=Fact(6.0, "assumption: three times the longest target interval of [C], 2.0 s"),
    cable_length_min=Fact(0.05, "derived: shortest cap distance in [C] 61 mm, less 3 x 4 mm noise"),
    cable_length_max=Fact(0.35, "derived: longest cap distance in [C] 332 mm, plus 3 x 4 mm noise, rounded up"),
    cap_height_max=Fact(0.3425, "derived: a rod upright on the ground, rod length + cap radius"),
    friction=Fact(0.76, "[R2] identified by the authors for the Yale robot (set `Will`: .759); .41-1.17 elsewhere"),
    restitution=Fact(0.0, "assumption: [R2] identified -.164, below 0 is unphysical"),
    colors=_HUES,
)  # fmt: skip

THREEBAR_330 = replace(
    THREEBAR,
    name="threebar-330",
    title="3-bar prismatic tensegrity, 33 cm rods: the newer open-source platform",
    about=("The newer open-source platform: configuration v3 of the authors' simulator, three WiFi boards.",),
    rod_length=Fact(0.295, "[R2] cap centre to cap centre; 0.330 tip to tip"),
    parts=(
        Part("cap", True, "sphere", Fact(0.0151, "[R2] 15.1 g each"),
             Fact(0.1475, "derived: half the rod length"), _CAP_RADIUS),
        Part("motor", True, "tube", Fact(0.0581, "[R2] 58.1 g each"),
             Fact(0.1039, "[R2] 103.9 mm"), Fact(0.02, "[R2] 20 mm"), Fact(0.055, "[R2] 55 mm"),
             Fact(0.0016, "assumption: hollow [R1], the rod (1.6 mm) runs through it")),
        Part("housing", False, "tube", Fact(0.09, "[R2] 90 g"), Fact(0.0, "assumption: centred"),
             Fact(0.02, "assumption: as wide as the motors"), Fact(0.143, "[R2] 143 mm"),
             Fact(0.0016, "assumption: the rod (1.6 mm) runs through it")),
        Part("rod", False, "cylinder", Fact(0.0065, "[R2] 6.5 g"), Fact(0.0, "assumption: centred"),
             Fact(0.0016, "[R2] 1.6 mm"), Fact(0.295, "assumption: uniform, cap to cap")),
    ),
    rod_mass=Fact(0.2429, "[R2] 242.9 g"),
    passive_rest_length=Fact(0.14, "[R2] 140 mm (130 mm in the model of 2026)"),
    motors=tuple(
        MotorFact(board, sign)
        for board, sign in zip(("blue", "green", "red", "green", "red", "blue"), (1, -1, 1, 1, -1, -1), strict=True)
    ),
    board_source="[R3] boards 0 red: motors 2, 4; 1 green: 1, 3; 2 blue: 0, 5",
    sign_source="[R3] `flip`, one robot's example: check it on yours before it moves",
    speed=Fact(0.7, "[R3] max_speed 70 of 99"),
    winch_radius=Fact(0.003175, "[R3] host: winch diameter 6.35 mm"),
    p=Fact(10.0, "[R1] P 10 on the new robot"),
    i=Fact(0.01, "[R1] I .01"),
    d=Fact(0.5, "[R1] D .5"),
    tolerance=Fact(0.15, "[R3] tol .15"),
    min_length=Fact(0.1, "[R3] 100 mm, between cap centres"),
    range=Fact(0.1, "assumption: as on the 360 mm robot; [R3] RANGE is 70-170 mm, set per behaviour"),
    step_timeout=Fact(6.0, "assumption: as on the 360 mm robot"),
    cable_length_min=Fact(0.045, "assumption: that of the 360 mm robot, scaled by the rod length"),
    cable_length_max=Fact(0.32, "assumption: that of the 360 mm robot, scaled by the rod length, rounded up"),
    cap_height_max=Fact(0.3125, "derived: a rod upright on the ground, rod length + cap radius"),
    friction=Fact(1.17, "[R2] identified by the authors for the new robot: 1.172"),
    restitution=Fact(0.0, "assumption: [R2] identified -.240, below 0 is unphysical"),
)  # fmt: skip

_SIX_ACTUATED, _SIX_PASSIVE = sixbar_cables()
_SIX_EDGE = round(float(EDGE_PER_ROD) * 0.325, 6)

SIXBAR = replace(
    THREEBAR,
    name="sixbar",
    title="ILLUSTRATIVE six-bar tensegrity with the rods of the 3-bar robot; nobody has built it",
    about=(
        "ILLUSTRATIVE: a made-up robot that shows that another robot is another file. Six rods of the 360 mm robot,",
        "12 winched cables (four triangles that share no cap) and 12 of its passive tendons.",
    ),
    illustrative=True,
    rods=tuple((f"rod{i}", f"end caps {2 * i}, {2 * i + 1}; made up") for i in range(6)),
    actuated=_SIX_ACTUATED,
    passive=_SIX_PASSIVE,
    support=sixbar_support(),
    cables_source="derived: the 24 edges of the 8 closed triangles",
    motors=tuple(MotorFact("", 1) for _ in range(12)),
    board_source="",
    sign_source="made up",
    sensors=False,
    min_length=Fact(round(_SIX_EDGE - 0.1, 6), "derived: sqrt(6)/4 of the rod length, less range_m"),
    range=Fact(0.1, "assumption: as on the 360 mm robot"),
    step_timeout=Fact(6.0, "assumption: as on the 360 mm robot"),
    cable_length_min=Fact(0.05, "assumption: as on the 360 mm robot"),
    cable_length_max=Fact(0.35, "assumption: as on the 360 mm robot"),
    cap_height_max=Fact(0.4, "derived: the rest pose is 0.30 m high; a third more"),
    colors=(),
)  # fmt: skip

FACTS: dict[str, RobotFacts] = {facts.name: facts for facts in (THREEBAR, THREEBAR_330, SIXBAR)}

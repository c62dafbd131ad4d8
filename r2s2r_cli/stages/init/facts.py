"""The robots' numbers, each with its source. `robots.py` writes them down, sites and rest pose are derived.

docs/concepts/robots.md says the same at length: which file or section a source is, why an assumption was made, how to
measure yours. A test keeps its tables equal to these numbers.
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.stages.init.prism import PRISM_CABLES, PRISM_SUPPORT
from r2s2r_cli.stages.init.robot_facts import Fact, HsvFact, MotorFact, Part, RobotFacts
from r2s2r_cli.stages.init.sixbar import EDGE_PER_ROD, sixbar_cables, sixbar_support

LEGEND = (
    "[S] the authors' public simulator, nchen9191/tensegrity_diff_physics_public: configurations v1 to v3",
    "[H] the robot's public host and firmware, ChemStud24/tensegrity",
    "[T] the authors' public tracker, shiyoung77/tensegrity_perception",
    "[P] the paper: Real2Sim2Real Transfer for Control of Cable-driven Robots via a Differentiable Physics Engine",
    "[C] the crawl of the 360 mm robot of 2023-02-21, published with [S]",
    "derived: computed from the other numbers.  assumption: nobody has published it.",
    "Files and sections, reasons, how to measure yours: docs/concepts/robots.md",
)

_RODS = (
    ("red", "end caps 0, 1"),
    ("green", "end caps 2, 3"),
    ("blue", "end caps 4, 5"),
)
_ROD_RADIUS = Fact(0.0016, "[S]")
_CAP_RADIUS = Fact(0.0175, "[S]")
_HUES = (HsvFact("red", (165, 180)), HsvFact("green", (60, 78)), HsvFact("blue", (103, 120)))
HSV_SOURCE = "[T] 8-bit OpenCV hue, 0..180"
SATURATION_MIN = Fact(100, "[T]")
VALUE_MIN = Fact(25, "[T] 25 to 30; the lower keeps shaded caps")

THREEBAR = RobotFacts(
    name="threebar",
    title="untethered 3-bar prismatic tensegrity, 36 cm rods: the robot of the paper",
    about=("Where the authors' configurations differ, v1 (Yale) holds.",),
    illustrative=False,
    rods=_RODS,
    rod_length=Fact(0.325, "[S] cap centre to cap centre; 0.360 tip to tip [P]"),
    rod_radius=_ROD_RADIUS,
    cap_radius=_CAP_RADIUS,
    parts=(
        Part("cap", True, "sphere", Fact(0.0105, "[S]"),
             Fact(0.1625, "derived: half the rod length"), _CAP_RADIUS),
        Part("motor", True, "tube", Fact(0.0353, "[S]"),
             Fact(0.1175, "[S] v1; 0.1025 on v2"), Fact(0.0175, "[S]"),
             Fact(0.045, "[S]"), Fact(0.0016, "assumption: the rod runs through it")),
        Part("rod", False, "cylinder", Fact(0.0418, "[S] with electronics; the bare rod weighs 0.0038"),
             Fact(0.0, "assumption: centred"), Fact(0.0016, "[S]"),
             Fact(0.325, "assumption, as in [S]: electronics spread along the rod")),
    ),
    rod_mass=Fact(0.1334, "[S]"),
    actuated=PRISM_CABLES[:6],
    passive=PRISM_CABLES[6:],
    support=PRISM_SUPPORT,
    cables_source="[S] and [H], the same numbers",
    actuated_stiffness=Fact(2000.0, "assumption: nearly inelastic, 4 N stretch it 2 mm"),
    actuated_damping=Fact(4.0, "assumption, chosen with that stiffness"),
    passive_stiffness=Fact(100.0, "[S] 10 as written, times 10 for the true g"),
    passive_damping=Fact(1.0, "[S] as written"),
    passive_rest_length=Fact(0.165, "[S] v1; 0.170 on v2"),
    motors=tuple(MotorFact("central", 1) for _ in range(6)),
    board_source="[H] one BLE central drives all six",
    sign_source="assumption: positive shortens [H]; check it before the robot moves",
    no_load=Fact(23.038, "[S] 220 rpm"),
    speed=Fact(0.8, "[C]; 0.7 to 0.8 in [S]"),
    winch_radius=Fact(0.0035, "[S] and [C]"),
    sensors=True,
    p=Fact(6.0, "[H]"),
    i=Fact(0.01, "[H]"),
    d=Fact(0.5, "[H]"),
    tolerance=Fact(0.12, "[H]; 0.1 in [C]"),
    min_length=Fact(0.095, "[C] between cap centres"),
    range=Fact(0.1, "[C]"),
    rate=Fact(50.0, "[H] about that, the rate of the sensors"),
    step_timeout=Fact(6.0, "assumption: three times the longest target interval of [C]"),
    cable_length_min=Fact(0.05, "derived: shortest in [C] 0.061, less 3 sd of noise"),
    cable_length_max=Fact(0.35, "derived: longest in [C] 0.332, plus 3 sd of noise, rounded up"),
    cap_height_max=Fact(0.3425, "derived: a rod upright on the ground"),
    friction=Fact(0.76, "[S] identified for v1; 0.41 to 1.17 elsewhere"),
    restitution=Fact(0.0, "assumption: [S] identified -0.16, which is unphysical"),
    colors=_HUES,
)  # fmt: skip

THREEBAR_330 = replace(
    THREEBAR,
    name="threebar-330",
    title="3-bar prismatic tensegrity, 33 cm rods: the newer open-source platform",
    about=("Configuration v3 of the authors' simulator, three WiFi boards.",),
    rod_length=Fact(0.295, "[S] cap centre to cap centre; 0.330 tip to tip"),
    parts=(
        Part("cap", True, "sphere", Fact(0.0151, "[S]"),
             Fact(0.1475, "derived: half the rod length"), _CAP_RADIUS),
        Part("motor", True, "tube", Fact(0.0581, "[S]"),
             Fact(0.1039, "[S]"), Fact(0.02, "[S]"), Fact(0.055, "[S]"),
             Fact(0.0016, "assumption: the rod runs through it")),
        Part("housing", False, "tube", Fact(0.09, "[S]"), Fact(0.0, "assumption: centred"),
             Fact(0.02, "assumption: as wide as the motors"), Fact(0.143, "[S]"),
             Fact(0.0016, "assumption: the rod runs through it")),
        Part("rod", False, "cylinder", Fact(0.0065, "[S]"), Fact(0.0, "assumption: centred"),
             Fact(0.0016, "[S]"), Fact(0.295, "assumption: uniform, cap to cap")),
    ),
    rod_mass=Fact(0.2429, "[S]"),
    passive_rest_length=Fact(0.14, "[S]; 0.130 in the authors' model of 2026"),
    motors=tuple(
        MotorFact(board, sign)
        for board, sign in zip(("blue", "green", "red", "green", "red", "blue"), (1, -1, 1, 1, -1, -1), strict=True)
    ),
    board_source="[H] red: motors 2, 4; green: 1, 3; blue: 0, 5",
    sign_source="[H] one robot's `flip`: check yours before it moves",
    speed=Fact(0.7, "[H] 70 of 99"),
    winch_radius=Fact(0.003175, "[H]"),
    p=Fact(10.0, "[S]"),
    i=Fact(0.01, "[S]"),
    d=Fact(0.5, "[S]"),
    tolerance=Fact(0.15, "[H]"),
    min_length=Fact(0.1, "[H] between cap centres"),
    range=Fact(0.1, "assumption: as on the 360 mm robot; 0.07 to 0.17 in [H]"),
    step_timeout=Fact(6.0, "assumption: as on the 360 mm robot"),
    cable_length_min=Fact(0.045, "assumption: the 360 mm robot's, scaled by rod length"),
    cable_length_max=Fact(0.32, "assumption: the 360 mm robot's, scaled, rounded up"),
    cap_height_max=Fact(0.3125, "derived: a rod upright on the ground"),
    friction=Fact(1.17, "[S] identified for this robot"),
    restitution=Fact(0.0, "assumption: [S] identified -0.24, which is unphysical"),
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

"""The plan: gaits found in the simulator and what they are worth, the robot's symmetries, and long policies of them.

`policies/NAME` holds every gait and every long policy as it is run; `r2s2r record 40-plan.h5:NAME` runs one. Numbers of a
gait are told in the frame of its start: x along the principal axis, y forward, z up.
"""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column
from schemas.policy import policy_group
from schemas.simulation import SIMULATION

FACTS = GroupSpec(
    path="plan",
    description="how it was planned",
    required=True,
    attributes=(
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="engine", type="str", description="what simulated: name and version"),
        AttributeSpec(name="numbers", type="str", description="where the simulator's numbers come from, in words"),
        AttributeSpec(name="identified", type="bool", description="they come from an identification"),
        AttributeSpec(name="seed", type="int", description="seed of drawn numbers and start poses"),
        AttributeSpec(name="step", type="float", unit="s", description="time step of the engine"),
        AttributeSpec(name="depth", type="int", description="target shapes of a gait, the return to rest included"),
        AttributeSpec(name="simulated", type="int", description="targets that the search simulated"),
        AttributeSpec(name="pruned", type="int", description="classes of poses that the beam of the search left behind"),
        AttributeSpec(name="lost", type="int", description="targets that were given up in the search, and what follows them"),
        AttributeSpec(name="found", type="int", description="gaits that the search found, from rest to rest"),
    ),
)  # fmt: skip

SYMMETRY = GroupSpec(
    path="symmetry",
    description="the symmetries of the robot's rest shape, the identity first: where each part goes",
    required=True,
    datasets=(
        column("caps", "int64", ("element", "cap"), "index", "end cap whose place each end cap takes"),
        column("cables", "int64", ("element", "cable"), "index", "cable whose place each cable takes"),
        column("motors", "int64", ("element", "actuated"), "index", "motor that does what each motor did: its place among the actuated cables"),
        column("turn", "float64", ("element", "xyz", "xyz2"), "1", "rotation of the rest shape about its centroid", frame="W"),
        column("misfit", "float64", ("element",), "m", "root mean square distance of the turned caps from those whose places they take"),
        column("support", "int64", ("element", "corner"), "index", "end caps that the robot then stands on"),
    ),
)  # fmt: skip

REFERENCE = GroupSpec(
    path="reference",
    description="the rest pose that all poses are mapped to",
    required=True,
    datasets=(
        column("p", "float64", ("cap", "xyz"), "m", "end caps, principal axis along x, centroid above the origin", frame="start"),
    ),
)  # fmt: skip

PRIMITIVES = GroupSpec(
    path="primitives",
    description="the best gaits of every behaviour, by score",
    required=True,
    datasets=(
        column("name", "str", ("primitive",), "1", "name; the policy of this name is the gait"),
        column("behaviour", "str", ("primitive",), "1", "what it was rewarded for: m for displacements, rad for turns, the unit of a user's own reward"),
        column("nominal", "float64", ("primitive",), "1", "reward with the best numbers, from the rest pose"),
        column("mean", "float64", ("primitive",), "1", "mean reward over drawn numbers and start poses; 0 where it did not come back to rest on its usual triangle"),
        column("sd", "float64", ("primitive",), "1", "standard deviation of that reward"),
        column("score", "float64", ("primitive",), "1", "mean less the spread: what gaits are ranked by"),
        column("worked", "float64", ("primitive",), "1", "share of the draws in which it reached all targets and came back to rest"),
        column("shift", "float64", ("primitive", "pair"), "m", "displacement of the centre of mass, mean of the draws that worked", frame="start"),
        column("shift_sd", "float64", ("primitive", "pair"), "m", "its standard deviation", frame="start"),
        column("turn", "float64", ("primitive",), "rad", "turn of the principal axis, counter-clockwise positive, mean of the draws that worked"),
        column("turn_sd", "float64", ("primitive",), "rad", "its standard deviation"),
        column("element", "int64", ("primitive",), "index", "symmetry that the robot has undergone at its end, row of `symmetry`"),
        column("same_element", "float64", ("primitive",), "1", "share of the draws that worked which end so"),
        column("duration", "float64", ("primitive",), "s", "mean duration"),
    ),
)  # fmt: skip

LONG = GroupSpec(
    path="long",
    description="long policies: gaits one after the other, relabelled and smoothed",
    datasets=(
        column("name", "str", ("long",), "1", "name of the policy"),
        column("gaits", "str", ("long",), "1", "its gaits in order, separated by spaces"),
        column("shortcuts", "int64", ("long",), "count", "transitions that smoothing shortened"),
        column("saved", "int64", ("long",), "count", "targets that it left out"),
        column("expected", "float64", ("long", "xyz"), "1", "x [m], y [m] and turn [rad] of the sequence on paper, before smoothing", frame="start"),
        column("mean", "float64", ("long", "xyz"), "1", "x [m], y [m] and turn [rad] in the simulator, mean over draws that worked", frame="start"),
        column("sd", "float64", ("long", "xyz"), "1", "their standard deviations", frame="start"),
        column("worked", "float64", ("long",), "1", "share of the draws that reached all targets and came back to rest"),
        column("duration", "float64", ("long",), "s", "mean duration"),
        column("goal", "float64", ("long", "xyz"), "1", "x [m], y [m] and heading [rad] that were asked for", frame="start",
               nan_means="no place was asked for"),
    ),
)  # fmt: skip

PLAN = ArtifactSpec(
    kind="plan",
    version=1,
    title="planned policies",
    filename="40-plan.h5",
    level="iteration",
    groups=(
        FACTS, SYMMETRY, REFERENCE, PRIMITIVES, LONG, policy_group("policies/{policy}"),
        *(group.model_copy(update={"required": True}) if group.required else group for group in SIMULATION.groups),
    ),
)  # fmt: skip
"""Runs are simulated ones: the best gait of every behaviour, and the long policies."""

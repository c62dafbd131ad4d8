"""A simulated run: what `simulate` writes, and what an estimate is compared with."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column
from schemas.policy import policy_group
from schemas.recording import COMMANDS
from schemas.segments import INTERVALS, SEGMENTS

RUN = GroupSpec(
    path="runs/{run}",
    description="one simulated execution of one policy",
    required=True,
    attributes=(
        AttributeSpec(name="policy", type="str", description="name of the policy, or of the run whose commands were replayed"),
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="engine", type="str", description="what computed it: name and version"),
        AttributeSpec(name="step", type="float", unit="s", description="time step of the engine"),
        AttributeSpec(name="control", type="str", description="what drove the motors",
                      choices=("closed loop", "command replay")),
    ),
)  # fmt: skip

FRAMES = GroupSpec(
    path="runs/{run}/frames",
    description="state at every stored frame",
    required=True,
    datasets=(
        column("t", "float64", ("frame",), "s", "time since the start of the run"),
        column("p_WR", "float64", ("frame", "rod", "xyz"), "m", "middle between the caps of each rod", frame="W"),
        column("q_WR", "float64", ("frame", "rod", "quat"), "1", "orientation of each rod, xyzw; z towards the odd cap", frame="W"),
        column("v_WR", "float64", ("frame", "rod", "xyz"), "m/s", "velocity of the middle of each rod", frame="W"),
        column("w_WR", "float64", ("frame", "rod", "xyz"), "rad/s", "angular velocity of each rod", frame="W"),
        column("p_WE", "float64", ("frame", "cap", "xyz"), "m", "centres of the end caps", frame="W"),
        column("length", "float64", ("frame", "cable"), "m", "distance between the centres of the two end caps of each cable"),
        column("rest_length", "float64", ("frame", "cable"), "m", "length of each cable without tension, between its "
          "attachment points"),
        column("tension", "float64", ("frame", "cable"), "N", "tension of each cable"),
        column("contact", "bool", ("frame", "cap"), "bool", "the ground pushes this cap"),
    ),
)  # fmt: skip

SIMULATION = ArtifactSpec(
    kind="simulation",
    version=1,
    title="simulated runs",
    filename="simulation.h5",
    level="iteration",
    groups=(RUN, FRAMES, COMMANDS, INTERVALS, SEGMENTS, policy_group("runs/{run}/policy")),
)

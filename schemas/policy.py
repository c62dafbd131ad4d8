"""The policy: a sequence of target shapes. A hand-writable TOML file, and a group inside artifacts."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base import ArtifactSpec, AttributeSpec, Frozen, GroupSpec, column
from schemas.typed import Duration, Fraction, Wait

REPEAT_MAX = 100_000
"""A step takes seconds: ten thousand repeats of ten steps are a week."""


class PolicyStep(Frozen):
    """One target shape, held until every cable is done (event-based), then for `hold_s`."""

    target: tuple[Fraction, ...] = Field(min_length=1)
    """Position of each actuated cable: 0 short, 1 long."""
    hold_s: Duration = 0.0
    timeout_s: Wait | None = None
    """Go on after this time although a cable is not done; default: `pid.step_timeout_s` of the robot."""


class PolicyFile(Frozen):
    """A policy as written by hand: `r2s2r validate gait.toml` checks it."""

    schema_version: Literal[1]
    robot: str
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][\w.+-]*$")]
    description: str = ""
    repeat: Annotated[int, Field(strict=True, ge=1, le=REPEAT_MAX)] = 1
    """How often the whole sequence is run."""
    steps: tuple[PolicyStep, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check(self) -> Self:
        lengths = {len(step.target) for step in self.steps}
        if len(lengths) > 1:
            raise ValueError(f"steps: all targets must have the same length, received lengths {sorted(lengths)}")
        return self


def policy_group(path: str) -> GroupSpec:
    """The group that holds one policy, wherever an artifact keeps it."""
    return GroupSpec(
        path=path,
        description="a policy: target shapes in order",
        attributes=(
            AttributeSpec(name="robot", type="str", description="robot the policy was written for"),
            AttributeSpec(name="description", type="str", description="what it does, in words", required=False),
            AttributeSpec(name="repeat", type="int", description="how often the sequence is run"),
        ),
        datasets=(
            column("target", "float64", ("step", "actuated"), "1", "cable positions, 0 short .. 1 long"),
            column("hold", "float64", ("step",), "s", "time held once all cables are done"),
            column("timeout", "float64", ("step",), "s", "time after which the step is given up", nan_means="the robot's default"),
        ),
    )  # fmt: skip


POLICY = ArtifactSpec(
    kind="policy",
    version=1,
    title="policies",
    filename="policies.h5",
    level="project",
    groups=(policy_group("policies/{policy}"),),
)

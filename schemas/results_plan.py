"""What `plan` says about gaits and policies: printed as tables, and put into its `--json` document. SI."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen


class GaitFigures(Frozen):
    """One gait of one behaviour. Numbers of a gait are in the frame of its start, x along the principal axis."""

    name: str
    behaviour: str
    shapes: tuple[str, ...]
    """Target shapes, a digit a motor: 0 short, 1 long."""
    nominal: float
    """Reward with the best numbers, from the rest pose: m of displacement, rad of turn."""
    mean: float
    sd: float
    score: float
    worked: float
    shift_m: tuple[float, float]
    turn_rad: float
    duration_s: float


class PolicyFigures(Frozen):
    """One long policy."""

    name: str
    gaits: tuple[str, ...]
    targets: int
    shortcuts: int
    saved: int
    """Targets that smoothing left out."""
    expected_m: tuple[float, float]
    """Of the sequence on paper, before smoothing."""
    expected_turn_rad: float
    shift_m: tuple[float, float]
    """In the simulator, mean over drawn numbers and start poses."""
    shift_sd_m: tuple[float, float]
    turn_rad: float
    turn_sd_rad: float
    worked: float
    duration_s: float
    goal: tuple[float, float, float] | None = None
    """x [m], y [m], heading [rad] that were asked for."""


class PlanReport(Frozen):
    """A whole plan."""

    numbers: str
    """Where the simulator's numbers come from."""
    identified: bool
    symmetries: int
    found: int
    """Gaits from rest to rest."""
    simulated: int
    pruned: int
    lost: int
    draws: int
    """Drawn numbers of the simulator."""
    pairs: int
    """Of drawn numbers and start poses, on which every gait was judged."""
    gaits: tuple[GaitFigures, ...]
    policies: tuple[PolicyFigures, ...]
    computed_by: Literal["machine code", "torch"]
    wall_s: float = 0.0
    seconds: dict[str, float] = Field(default_factory=dict)
    warnings: tuple[str, ...] = ()

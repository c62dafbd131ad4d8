"""`--method paper`: what is free, how contacts are detached, and where a simulated run begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError, UsageError
from r2s2r_cli.stages.identify.free import Free, Mapping, select
from r2s2r_cli.stages.identify.paper.flight import World
from r2s2r_cli.stages.init.attachment import rod_frames
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine import Detach, State, Structure

PAPER_FREE = ("motor_speed", "friction")
"""What the paper identifies on the real robot (section Complete Evaluation)."""
RESTLESS = 0.01
"""[m/s] caps that still move so fast when settling gives up are not at rest."""


@dataclass(frozen=True)
class Preset:
    """world: the engine and the controller; numbers: what Adam moves."""

    robot: Robot
    world: World
    numbers: Mapping

    @property
    def first(self) -> np.ndarray:
        """Values that Adam starts from, (n,)."""
        return np.array([free.start for free in self.numbers.frees])


def preset(
    robot: Robot,
    frees: Sequence[Free] | None = None,
    *,
    detach: Detach | None = None,
    effects: tuple[str, ...] = (),
    fixed: dict[str, float] | None = None,
    structure: Structure | None = None,
    step: float = 1e-3,
    cache_dir: Path | None = None,
) -> Preset:
    """The paper's fit for a robot; frees: default PAPER_FREE, from robot.toml's values.

    detach: default geometry, the bounded form of the paper's detachment. The whole impulse, as the paper has it, gives
    derivatives of 1e9 and either sign over a segment (docs/concepts/paper-identification.md); it is there for windows
    below half a second. Raises UsageError for a number that the engine does not read, and what Mapping raises.
    """
    from r2s2r_cli.engine import Detach, Simulator
    from r2s2r_cli.stages.model import structure_of

    chosen = select(PAPER_FREE, robot, effects) if frees is None else tuple(frees)
    base = replace(structure or structure_of(robot), detach=detach or Detach.GEOMETRY)
    numbers = Mapping(robot, chosen, effects, fixed=fixed, structure=base)
    outside = [free.name for free, inside in zip(chosen, numbers.in_engine, strict=True) if not inside]
    if outside:
        raise UsageError(
            f"{outside[0]} has no derivative in the paper's method", where="--free",
            expected="numbers of the robot and its ground", received=", ".join(outside),
            hint=f"r2s2r identify --free {outside[0]}   # the default method",
        )  # fmt: skip
    simulator = Simulator(numbers.structure, cache_dir=cache_dir)
    pid = numbers.pid(np.array([free.start for free in chosen]))
    return Preset(robot, World(simulator, pid, robot.pid.step_timeout_s, step), numbers)


def settled_start(made: Preset, p_WE: np.ndarray, *, run: str = "the run") -> State:
    """The simulated robot at rest at the first observed caps of a run, p_WE (cap, 3) [m].

    Paper, System Identification: cable lengths and end caps at t = 0, then gravity. It is an observation: it has no
    derivative, and stays through the fit. Raises NumericalError.
    """
    import torch

    from r2s2r_cli.engine import settled

    theta = made.numbers.theta(made.first)
    found = settled(
        made.world.simulator, theta, torch.as_tensor(p_WE)[None], torch.as_tensor(rod_frames(p_WE))[None],
        made.world.pid.cable_caps, step=made.world.step,
    )  # fmt: skip
    if not float(found.speed.max()) <= RESTLESS:
        raise NumericalError(
            "the robot does not come to rest where the run begins", where=run, expected="a pose that can be held",
            received=f"caps still at {1e3 * float(found.speed.max()):.0f} mm/s", hint="r2s2r validate robot.toml",
        )  # fmt: skip
    return found.state

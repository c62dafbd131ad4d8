"""The engine as a library: a rollout, its gradient, the controller in the loop, and a law of one's own.

Run `python examples/05_engine_library/run.py`; docs/guides/engine-as-a-library.md explains it line by line.
"""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect, EffectParameter, with_off_values
from r2s2r_cli.engine import (
    Channel,
    LatchedPid,
    Parameters,
    Simulator,
    State,
    Structure,
    Trajectory,
    closed_loop,
    settled,
)
from r2s2r_cli.engine.hooks import Values, WorldTerms
from r2s2r_cli.stages.init.attachment import rod_frames
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, structure_of
from schemas.robot import Robot


class Bench(NamedTuple):
    """A robot in the engine, at rest."""

    robot: Robot
    structure: Structure
    theta: Parameters
    simulator: Simulator
    start: State


def bench() -> Bench:
    """The 3-bar robot, settled in its rest pose. Your own: tomllib.load of its robot.toml."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    structure, theta = structure_of(robot), parameters_of(robot)
    simulator = Simulator(structure)
    p_WE = np.array(robot.rest_caps_m)
    cable_caps = tuple(cable.caps for cable in robot.cables)
    rest = settled(simulator, theta, torch.tensor(p_WE)[None], torch.tensor(rod_frames(p_WE))[None], cable_caps)
    return Bench(robot, structure, theta, simulator, rest.state)


def gait() -> Tensor:
    """Motor commands (1, 7, 6), each held for 0.2 s: reel in cables 1, 3, 4 and 5, then pay 1 out and reel 2 in."""
    first, second = torch.zeros(2, 6, dtype=torch.float64)
    first[[1, 3, 4, 5]] = 1.0
    second[1], second[2] = -1.0, 1.0
    return torch.stack([first] * 5 + [second] * 2)[None]


def displacement(theta: Parameters, run: Trajectory) -> Tensor:
    """How far the centre of mass came over the ground [m], (B,)."""
    com = (theta.mass[..., None] * run.states.p_WB).sum(-2) / theta.mass.sum(-1)[..., None]
    return torch.linalg.vector_norm((com[:, -1] - com[:, 0])[:, :2], dim=-1)


def moved_by(b: Bench, friction: Tensor, speed: Tensor) -> Tensor:
    """The displacement [m] of the gait for friction coefficients and motor speeds (1: as in robot.toml), each (B,).

    One batch simulates all of them side by side.
    """
    each = friction[:, None]
    theta = replace(
        b.theta, friction=each[..., None] * torch.ones_like(b.theta.friction),
        speed_in=speed[:, None] * b.theta.speed_in, speed_out=speed[:, None] * b.theta.speed_out,
    )  # fmt: skip
    run = b.simulator.rollout(theta, b.start, gait().expand(len(friction), -1, -1), step=1e-3, hold=200, every=1400)
    return displacement(b.theta, run)


def gradient(b: Bench) -> tuple[Tensor, Tensor]:
    """Derivatives of the displacement by friction [m] and by motor speed [m], each (1,), in one reverse pass."""
    friction = torch.tensor([0.76], dtype=torch.float64, requires_grad=True)
    speed = torch.tensor([1.0], dtype=torch.float64, requires_grad=True)
    by_friction, by_speed = torch.autograd.grad(moved_by(b, friction, speed).sum(), (friction, speed))
    return by_friction, by_speed


def secants(b: Bench, h: float = 1e-5) -> tuple[Tensor, Tensor]:
    """The same by central differences, four environments at once."""
    step = h * torch.tensor([1.0, -1.0], dtype=torch.float64)
    none = torch.zeros_like(step)
    with torch.no_grad():
        x = moved_by(b, 0.76 + torch.cat([step, none]), 1.0 + torch.cat([none, step]))
    return (x[0] - x[1]) / (2 * h), (x[2] - x[3]) / (2 * h)


class Drag(Effect):
    """A law of one's own: something pulls every rod back in proportion to its velocity. Off: c = 0."""

    name = "drag"
    channel = Channel.WORLD
    title = "linear drag on every rod"
    own = (EffectParameter("c", "N s/m", 0.0, 5.0, off=0.0, scale=1.0, what="force per velocity of a rod's centre"),)

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "fast motions are shorter than simulated, slow ones are not"

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Force on every rod, (B, rod, 3)."""
        return force - x["c"][..., None] * terms.v_GB, torque


def with_drag(b: Bench, c: float) -> tuple[Simulator, Parameters]:
    """A simulator with the law compiled in, and its parameters."""
    structure = b.structure.with_effects(Drag())
    theta = with_off_values(structure, b.theta)
    return Simulator(structure), theta.with_values({"drag.c": torch.full((1, 1), c, dtype=torch.float64)})


def controller(robot: Robot) -> LatchedPid:
    """The low-level controller of robot.toml."""
    pid = robot.pid
    return LatchedPid(
        p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m, range=pid.range_m,
        period=1 / pid.rate_hz, cable_caps=tuple(cable.caps for cable in robot.cables), actuated=robot.actuated,
    )  # fmt: skip


def main() -> None:
    """Run and print."""
    b = bench()
    run = b.simulator.rollout(b.theta, b.start, gait(), step=1e-3, hold=200, every=20)
    height = float(run.end_caps()[0, -1, 4, 2])
    print(f"rollout      {len(run.t)} frames, {float(run.t[-1]):.1f} s; moved {_mm(displacement(b.theta, run))}, "
          f"cap 4 at {1e3 * height:.0f} mm")  # fmt: skip

    for name, slope, secant in zip(("friction", "motor speed"), gradient(b), secants(b), strict=True):
        print(f"gradient     by {name}: {_mm(slope)}, by central difference {_mm(secant)}")

    targets = torch.tensor([[1, 0.1, 1, 0, 0, 0], [1, 1, 0.1, 0, 0, 0], [1, 1, 1, 1, 1, 1]], dtype=torch.float64)
    holds, timeouts = torch.zeros(3), torch.full((3,), b.robot.pid.step_timeout_s)
    with torch.no_grad():
        loop = closed_loop(b.simulator, b.theta, b.start, controller(b.robot), targets, holds, timeouts)
    seconds = float(loop.duration(1 / b.robot.pid.rate_hz))
    print(f"closed loop  3 shapes in {seconds:.2f} s, {int(loop.timed_out.sum())} given up; "
          f"moved {_mm(displacement(b.theta, loop.trajectory))}")  # fmt: skip

    for c in (0.0, 2.0):
        simulator, theta = with_drag(b, c)
        slowed = simulator.rollout(theta, b.start, gait(), step=1e-3, hold=200, every=20)
        print(f"own effect   drag {c:g} N s/m: moved {_mm(displacement(theta, slowed))}")


def _mm(x: Tensor) -> str:
    return f"{1e3 * float(x):.4f} mm"


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()

"""The paper's synthetic task: a closed-loop run at motor speed 0.5 is given, and Adam looks for that speed."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from r2s2r_cli.engine import Detach, EngineError, State
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.paper import (
    Demonstration,
    Loss,
    Preset,
    compare,
    fly,
    fly_side_by_side,
    preset,
    seen,
    settled_start,
    synthetic,
)
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.simulate.policies import random_policy, sequence
from schemas.robot import Robot

Array = NDArray[np.float64]
TRUTH, RATE = 0.5, 0.1
LOWER, UPPER = 0.1, 1.5
"""Bounds of the motor speed [1]; the paper gives none."""


@dataclass(frozen=True)
class Task:
    """One policy. made: the robot in the engine, motor speed free; start: at rest; demo: the run to be imitated."""

    made: Preset
    start: State
    demo: Demonstration
    targets: Array


def robot() -> Robot:
    """The three-bar robot of `r2s2r init`."""
    return Robot.model_validate(tomllib.loads(robot_toml("threebar")))


def engine(detach: Detach | None = None, free: str = f"motor_speed={TRUTH},{LOWER}..{UPPER}") -> Preset:
    """The paper's preset with one free number, which starts at its truth."""
    return preset(robot(), select([free], robot()), detach=detach)


def task(made: Preset, seed: int, shapes: int, *, noise_sd: float = 0.0, every: int = 1) -> Task:
    """A random policy of so many shapes; the truth is where the numbers of `made` start. noise_sd [m]: of the observed
    caps; every: ticks a frame."""
    targets = sequence(random_policy(made.robot, shapes, seed), made.robot).target
    theta = made.numbers.theta(made.first)
    start = settled_start(made, np.array(made.robot.rest_caps_m))
    truth = fly(made.world, theta, start, targets)
    p_WE = seen(made.world, theta, truth.states).numpy()
    demo = synthetic(made.world.simulator, truth, p_WE, targets, noise_sd=noise_sd, every=every, seed=seed)
    return Task(made, start, demo, targets)


@dataclass(frozen=True)
class Descent:
    """Fits side by side, before every update: losses [m^2] and motor speeds [1], (iteration, fit)."""

    losses: Array
    speeds: Array


def descend(one: Task, losses: list[Loss], firsts: list[float], iterations: int) -> Descent:
    """`identify_paper` for several fits at once: their closed loops are simulated as one batch. Adam treats every
    number by itself, so that each fit is what it would be alone. A fit whose derivative is no number stays put."""
    x = torch.tensor(firsts, dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([x], lr=RATE)
    world, numbers = one.made.world, one.made.numbers
    history, speeds = [], []
    for _ in range(iterations):
        now = x.detach().clone()
        flights = fly_side_by_side(world, numbers.theta(now[:, None]), one.start, one.targets)
        row, slopes = [], []
        for loss, value, flight in zip(losses, now, flights, strict=True):
            v = value[None].clone().requires_grad_()
            try:
                total = compare(loss, world, numbers.theta(v), flight, one.demo).value.total
                slope = torch.autograd.grad(total, v)[0]
            except EngineError:
                total, slope = torch.tensor(torch.nan), torch.full((1,), torch.nan)
            row.append(total.item())
            slopes.append(torch.nan_to_num(slope, 0.0, 0.0, 0.0))
        history.append(row)
        speeds.append(now.numpy())
        x.grad = torch.cat(slopes).double()
        adam.step()
        with torch.no_grad():
            x.clamp_(LOWER, UPPER)
    return Descent(np.array(history), np.array(speeds))

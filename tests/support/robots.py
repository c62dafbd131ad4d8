"""Robots of `init` in the engine: settled, with their controllers and cables. For tests of whole robots."""

from __future__ import annotations

import tomllib
from functools import lru_cache

import torch
from torch import Tensor

from r2s2r_cli.engine import LatchedPid, Parameters, Settled, State, Structure, cap_lengths, end_caps, settled
from r2s2r_cli.stages.init.attachment import Mode, rod_frames
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, structure_of
from schemas.robot import Robot
from tests.support.engine import G, simulator


class Subject:
    """A robot of `init` in the engine, with its observed rest pose."""

    def __init__(self, name: str, attachment: Mode = "surface") -> None:
        self.robot = robot = Robot.model_validate(tomllib.loads(robot_toml(name, attachment)))
        self.structure: Structure = structure_of(robot)
        self.theta: Parameters = parameters_of(robot)
        self.simulator = simulator(self.structure)
        self.cable_caps = tuple((cable.caps[0], cable.caps[1]) for cable in robot.cables)
        self.winched = list(robot.actuated)
        self.p_WE = torch.tensor(robot.rest_caps_m, dtype=torch.float64)[None]
        self.weight = float(self.theta.mass.sum()) * G

    def settle(self, p_WE: Tensor, R_WR: Tensor | None = None, lengths: Tensor | None = None) -> Settled:
        """Settled from p_WE, with the frames that the heuristic gives it unless R_WR says otherwise."""
        R_WR = frames(p_WE) if R_WR is None else R_WR
        return settled(self.simulator, self.theta, p_WE, R_WR, self.cable_caps, lengths=lengths)

    def lengths(self, state: State) -> Tensor:
        """Cap distances of all cables [m]."""
        return cap_lengths(self.cable_caps, end_caps(self.theta, state))

    def pid(self) -> LatchedPid:
        """The controller of robot.toml."""
        pid = self.robot.pid
        return LatchedPid(
            p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m, range=pid.range_m,
            period=1 / pid.rate_hz, cable_caps=self.cable_caps, actuated=self.robot.actuated,
        )  # fmt: skip

    def drift(self, state: State, seconds: float) -> float:
        """How far any cap comes in `seconds` with the motors off [m]."""
        still = torch.zeros(len(state.p_WB), 1, self.structure.n_actuated, dtype=torch.float64)
        p_WE = self.simulator.rollout(self.theta, state, still, hold=round(seconds * 1e3), every=100).end_caps()
        return float(torch.linalg.vector_norm(p_WE - p_WE[:, :1], dim=-1).max())


@lru_cache
def subject(name: str = "threebar", attachment: Mode = "surface") -> Subject:
    """A robot by name; one for the whole test session."""
    return Subject(name, attachment)


@lru_cache
def rested() -> Settled:
    """The three-bar robot, settled from its rest pose."""
    return subject().settle(subject().p_WE)


def frames(p_WE: Tensor) -> Tensor:
    """Frames of the rods in the rest pose, for each environment."""
    return torch.stack([torch.as_tensor(rod_frames(p.numpy())) for p in p_WE])


def noise(p_WE: Tensor, size: float, *, batch: int, seed: int) -> Tensor:
    """Caps with normal noise of `size` [m]."""
    generator = torch.Generator().manual_seed(seed)
    return p_WE + size * torch.randn(batch, *p_WE.shape[1:], generator=generator, dtype=torch.float64)

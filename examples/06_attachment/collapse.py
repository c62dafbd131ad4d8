"""One robot with its cables at the rod ends or on the caps' surface, through the same random sequences of shapes."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from r2s2r_cli.engine import (
    LatchedPid,
    Simulator,
    State,
    cap_lengths,
    end_caps,
    pack_parameters,
    pack_state,
    settled,
    unpack_state,
)
from r2s2r_cli.stages.init.attachment import Mode, rod_frames
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, structure_of
from schemas.robot import Robot

MODES: tuple[Mode, ...] = ("rod_end", "surface")
STEP = 1e-3
"""[s]"""
SHAPE_S = 2.5
"""[s] that every shape is commanded for: 100 mm at 64.5 mm/s take 1.6 s."""
EXTENSIONS = 3
"""Times SHAPE_S of full extension at the end, to recover in."""
FLAT = 0.010
"""[m] a robot whose cap centres all lie between two planes this far apart has collapsed."""
RECOVERED = 0.5
"""Share of the thickness at rest that full extension must give back, or the robot is stuck."""


class Attached:
    """A robot with one attachment, settled in its rest pose."""

    def __init__(
        self, mode: Mode, name: str = "threebar", friction: float | None = None, *, rod_contact: bool = True
    ) -> None:
        robot = Robot.model_validate(tomllib.loads(robot_toml(name, mode)))
        if friction is not None:
            robot = robot.model_copy(update={"contact": robot.contact.model_copy(update={"friction": friction})})
        self.mode = mode
        self.structure, self.theta = replace(structure_of(robot), rod_contact=rod_contact), parameters_of(robot)
        self.simulator = Simulator(self.structure)
        self.cable_caps = tuple((a, b) for a, b in (cable.caps for cable in robot.cables))
        pid = robot.pid
        self.pid = LatchedPid(
            p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m, range=pid.range_m,
            period=1 / pid.rate_hz, cable_caps=self.cable_caps, actuated=robot.actuated,
        )  # fmt: skip
        p_WE = torch.tensor(robot.rest_caps_m, dtype=torch.float64)[None]
        R_WR = torch.as_tensor(rod_frames(p_WE[0].numpy()))[None]
        self.rest: State = settled(self.simulator, self.theta, p_WE, R_WR, self.cable_caps).state

    def caps(self, flat: Tensor) -> Tensor:
        """End caps [m], (B, cap, 3), of flat states."""
        theta = self.theta.map(lambda x: x.expand(len(flat), *x.shape[1:]))
        return end_caps(theta, unpack_state(self.structure, flat))

    def play(self, targets: Tensor) -> tuple[Tensor, Tensor]:
        """Shapes (N, S, actuated) in closed loop, each for SHAPE_S, then full extension: caps [m] at the start and
        after every shape, (N, 1 + S + EXTENSIONS, cap, 3); the motor commands until the extension (N, tick, actuated).
        """
        start = pack_state(self.structure, self.rest).expand(len(targets), -1)
        seen, commands, flat = self._controlled(start, targets)
        return torch.cat([self.caps(start)[:, None], seen, self._extended(flat)], dim=1), commands

    def replay(self, commands: Tensor) -> Tensor:
        """Motor commands (N, tick, actuated) of another robot, then full extension in closed loop: caps as `play`."""
        hold, every = round(self.pid.period / STEP), round(SHAPE_S / STEP)
        run = self.simulator.rollout(self.theta, self.rest, commands, step=STEP, hold=hold, every=every)
        flat = pack_state(self.structure, run.at(-1))
        return torch.cat([run.end_caps(), self._extended(flat)], dim=1)

    def _extended(self, flat: Tensor) -> Tensor:
        """Caps while all cables are commanded to be long."""
        ones = flat.new_ones(len(flat), EXTENSIONS, self.structure.n_actuated)
        return self._controlled(flat, ones)[0]

    def _controlled(self, flat: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Caps after every shape, motor commands, and the flat state at the end."""
        p = pack_parameters(self.structure, self.theta)
        hold = round(self.pid.period / STEP)
        seen, commands = [], []
        for target in targets.unbind(1):
            memory = self.pid.start(flat.new_zeros(len(flat), len(self.cable_caps)))
            for _ in range(round(SHAPE_S / self.pid.period)):
                u, memory = self.pid.tick(memory, cap_lengths(self.cable_caps, self.caps(flat)), target)
                flat = self.simulator.advance(flat, u[:, None], p, h=STEP, hold=hold, every=hold)[:, -1]
                commands.append(u)
            seen.append(self.caps(flat))
        return torch.stack(seen, dim=1), torch.stack(commands, dim=1), flat


@dataclass(frozen=True)
class Outcome:
    """Of N sequences. thickness: after every shape [m], (N, 1 + S + EXTENSIONS); collapsed: flat after some shape;
    stuck: not recovered after full extension; each (N,), bool."""

    thickness: Tensor
    collapsed: Tensor
    stuck: Tensor


def thickness(p_WE: Tensor) -> Tensor:
    """Extent of the caps (..., cap, 3) along the direction in which they spread least [m], (...)."""
    centred = p_WE - p_WE.mean(-2, keepdim=True)
    least = torch.linalg.eigh(centred.mT @ centred).eigenvectors[..., 0]
    along = (centred * least[..., None, :]).sum(-1)
    return along.amax(-1) - along.amin(-1)


def outcome(p_WE: Tensor) -> Outcome:
    """What became of caps (N, frame, cap, 3), the frames as in `Attached.play`."""
    thick = thickness(p_WE)
    flat = (thick[:, :-EXTENSIONS] < FLAT).any(dim=1)
    return Outcome(thick, flat, thick[:, -1] < RECOVERED * thick[:, 0])


def random_shapes(sequences: int, shapes: int, seed: int) -> Tensor:
    """Binary targets, short or long at even odds, (sequences, shapes, 6)."""
    made = torch.randint(0, 2, (sequences, shapes, 6), generator=torch.Generator().manual_seed(seed))
    return made.to(torch.float64)

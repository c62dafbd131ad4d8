"""Many policies at once: the robot's controller in the loop, every environment with targets and numbers of its own.

`engine.closed_loop` runs one policy from many starts; the search needs another target in every environment, and
environments that end at different times. The loop itself is `together.run_together`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.init.attachment import rod_frames
from r2s2r_cli.stages.model import structure_of
from r2s2r_cli.stages.plan.belief import Belief
from r2s2r_cli.stages.plan.standing import Executed, Standing, stacked
from r2s2r_cli.stages.plan.together import run_together
from r2s2r_cli.stages.ticks import whole_steps
from schemas.robot import Robot

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import LatchedPid, Parameters

CHUNK = 4096
"""Environments that are simulated together: more is not faster, and takes memory."""
RESTLESS = 0.01
"""[m/s] a start whose caps still move so fast after settling is none."""


class Executor:
    """A robot whose numbers are drawn from a belief. Holds the compiled step.

    draws: values (K, n) of the belief's parameters. timeout_s: a target that takes longer is given up. hurried: one
    that stalls is given up at once, and what comes after it is not simulated; else the timeout of the robot passes.
    bias: what the controller reads too much of every cable [m], (K, cable); None: nothing. Raises InputError where
    `step` [s] does not divide the control period.
    """

    def __init__(
        self, robot: Robot, belief: Belief, draws: np.ndarray, *, step: float, timeout_s: float | None = None,
        rod_contact: bool = True, hurried: bool = False, bias: np.ndarray | None = None, cache_dir: Path | None = None,
        threads: int = 1,
    ) -> None:  # fmt: skip
        import torch

        from r2s2r_cli.engine.flat import pack_parameters
        from r2s2r_cli.engine.hooks import effective
        from r2s2r_cli.engine.pid import ticks
        from r2s2r_cli.engine.rollout import Simulator
        from r2s2r_cli.stages.identify.free import Mapping

        self.robot, self.step, self.hurried = robot, step, hurried
        structure = replace(structure_of(robot), rod_contact=rod_contact)
        own = belief.model.mapping
        effects = tuple(effect.name for effect in own.structure.effects)
        self.mapping = Mapping(robot, own.frees, effects, fixed=own.fixed, structure=structure)
        self.structure = self.mapping.structure
        self._read_by = belief.model.read_by
        self.values = torch.as_tensor(draws, dtype=torch.float64)
        one = self.mapping.theta(self.values)
        self.theta = one.map(lambda x: x.expand(len(draws), *x.shape[1:]).contiguous())
        self.packed = pack_parameters(self.structure, self.theta)
        self.seen = effective(self.structure, self.theta)
        self.simulator = Simulator(self.structure, cache_dir=cache_dir, threads=threads)
        none = np.zeros((len(draws), len(robot.cables)))
        self.bias = torch.as_tensor(none if bias is None else bias, dtype=torch.float64)
        self.period = 1.0 / robot.pid.rate_hz
        self.whole = whole_steps(robot, step, "plan.step_s")
        self.cable_caps = tuple((a, b) for a, b in (cable.caps for cable in robot.cables))
        late = torch.tensor([self.mapping.observation(row).command_delay for row in draws], dtype=torch.float64)
        measured, numbers = belief.model.command_delay, own.observation(belief.model.values).command_delay
        # Draws differ by as much about what was measured.
        self.delay = late if measured is None else (late + measured - numbers).clamp(min=0.0)
        limit = robot.pid.step_timeout_s if timeout_s is None else timeout_s
        self.timeout = int(ticks(torch.tensor([limit], dtype=torch.float64), self.period)[0])
        self._substeps: int | None = None

    def __len__(self) -> int:
        return len(self.values)

    @property
    def computed_by_torch(self) -> bool:
        """Whether no machine code could be made."""
        return not self.simulator.kernels.native(self.theta.mass)

    def pid(self, draw: Tensor) -> LatchedPid:
        """The controller of environments with these draws."""
        return self._read_by(self.mapping.pid(self.values[draw]))

    def standing(self, p_WE: np.ndarray, draw: np.ndarray, lengths: np.ndarray | None = None) -> Standing:
        """Robots at rest nearest to poses (B, cap, 3) [m]; lengths: of all cables [m], (B, cable). Those that do not
        come to rest are left out. Raises NumericalError where the first does not."""
        import torch

        from r2s2r_cli.engine.flat import pack_state
        from r2s2r_cli.engine.settle import settled

        index = torch.as_tensor(np.asarray(draw, dtype=np.int64))
        theta = self.theta.map(lambda x: x[index])
        found = settled(
            self.simulator, theta, torch.as_tensor(p_WE), torch.as_tensor(np.array([rod_frames(p) for p in p_WE])),
            self.cable_caps, lengths=None if lengths is None else torch.as_tensor(lengths), step=self.step,
        )  # fmt: skip
        # Not "> RESTLESS": what is no number is not at rest either.
        restless = ~(found.speed <= RESTLESS)
        if bool(restless[0]):
            raise NumericalError(
                "the robot does not come to rest", where="the rest pose of robot.toml", expected="a pose it can hold",
                received=f"caps still at {1e3 * float(found.speed[0]):.0f} mm/s",
                hint="r2s2r validate robot.toml",
            )  # fmt: skip
        s = pack_state(self.structure, found.state)
        depth = int(torch.floor(self.delay.max() / self.period + 1e-9)) + 2
        every = Standing(s, s.new_zeros(len(s), depth, self.structure.n_actuated), index, s.new_zeros(len(s)))
        return every.take(np.flatnonzero(~restless.numpy()))

    def caps(self, at: Standing) -> np.ndarray:
        """End caps [m], (B, cap, 3)."""
        from r2s2r_cli.engine import end_caps
        from r2s2r_cli.engine.flat import unpack_state

        state = unpack_state(self.structure, at.s)
        return np.asarray(end_caps(self.seen.map(lambda x: x[at.draw]), state).numpy())

    def speeds(self, at: Standing) -> np.ndarray:
        """Speeds of the end caps [m/s], (B, cap)."""
        from r2s2r_cli.engine import cap_velocities
        from r2s2r_cli.engine.flat import unpack_state

        v_WE = cap_velocities(self.seen.map(lambda x: x[at.draw]), unpack_state(self.structure, at.s))
        return np.asarray(v_WE.norm(dim=-1).numpy())

    def com(self, at: Standing) -> np.ndarray:
        """Centres of mass [m], (B, 3)."""
        from r2s2r_cli.engine.flat import unpack_state

        mass = self.theta.mass[at.draw]
        p_WB = unpack_state(self.structure, at.s).p_WB
        return np.asarray(((p_WB * mass[..., None]).sum(1) / mass.sum(1, keepdim=True)).numpy())

    def run(
        self, at: Standing, targets: np.ndarray, counts: np.ndarray | None = None, *, record: bool = False
    ) -> Executed:
        """Targets (B, S, actuated) from where the robots stand, with the robot's controller; no time is held.

        counts: how many of its targets each is to reach, (B,); None: all. record: keep every tick. B may be 0.
        """
        import torch

        counts = np.full(len(at), targets.shape[1]) if counts is None else np.asarray(counts)
        if not len(at):
            nothing = np.zeros((0, targets.shape[1]), dtype=bool)
            return Executed(
                (at,) * targets.shape[1], nothing.astype(np.int64), nothing, np.zeros(0, dtype=bool), counts
            )
        parts = []
        for first in range(0, len(at), CHUNK):
            rows = np.arange(first, min(first + CHUNK, len(at)))
            goals = torch.as_tensor(np.ascontiguousarray(targets[rows], dtype=float))
            parts.append(run_together(self, at.take(rows), goals, counts[rows], record=record))
        if len(parts) == 1:
            return parts[0]
        ends = tuple(stacked([p.ends[k] for p in parts]) for k in range(targets.shape[1]))
        named = {
            name: np.concatenate([getattr(p, name) for p in parts])
            for name in ("ticks", "given_up", "failed", "counts")
        }
        return Executed(ends, **named, tracks=tuple(track for p in parts for track in p.tracks))

    def numbers(self, draw: Tensor) -> tuple[Parameters, Tensor, LatchedPid]:
        """Parameters as their effects make them, packed ones and the controller of environments with these draws."""

        def of(x: Tensor) -> Tensor:
            return x[draw]

        return self.seen.map(of), self.packed[draw], self.pid(draw)

    def substeps(self, at: Standing) -> int:
        """Engine steps per `step`, as many as the stiffest of all draws needs."""
        from r2s2r_cli.engine.flat import unpack_state

        if self._substeps is None:
            theta = self.theta.map(lambda x: x[at.draw])
            self._substeps = self.simulator.substeps(theta, unpack_state(self.structure, at.s), self.step)
        return self._substeps

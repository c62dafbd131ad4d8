"""The engine at work for one robot: settle a start, run a policy in closed loop, replay commands, read the frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from r2s2r_cli.errors import InputError, NumericalError
from r2s2r_cli.stages.identified import Identified, nominal
from r2s2r_cli.stages.init.attachment import rod_frames
from r2s2r_cli.stages.simulate.frames import centre_of_mass, frame_datasets, joined, stored_rows, without_first
from r2s2r_cli.stages.simulate.policies import Sequence
from r2s2r_cli.stages.simulate.replay import Replay
from r2s2r_cli.stages.ticks import whole_steps
from schemas.config import SimulateSettings
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

RESTLESS = 0.01
"""[m/s] a robot whose caps still move so fast when settling gives up is not at rest: no run starts from there."""
REPLAY_SPELL_S = 1.0
"""Simulated time between two looks at the progress bar and at Ctrl-C."""

Progress = Callable[[int], None]
"""Called with the number of parts that are done: targets of a policy, spells of a replay."""


@dataclass(frozen=True)
class Start:
    """Where a run starts: observed caps [m], (cap, 3), frame W, at rest; words: what they are."""

    words: str
    p_WE: np.ndarray


@dataclass(frozen=True)
class Simulated:
    """One run as numbers; frames as in `schemas/simulation.py`, com (frame, 3) [m]; commands: one row a control tick or
    recorded command; at_frame: target and control at the frames."""

    frames: dict[str, np.ndarray]
    com: np.ndarray
    commands: dict[str, np.ndarray]
    target_at: np.ndarray
    control_at: np.ndarray
    timed_out: tuple[int, ...]
    substeps: int
    start_shift: float


class Driver:
    """A robot in the engine. Holds the compiled step, so one serves all runs.

    cache_dir: where machine code is kept. model: whose numbers are simulated; None: robot.toml's. Raises InputError for
    a robot that cannot be simulated.
    """

    def __init__(
        self, robot: Robot, settings: SimulateSettings, cache_dir: Path | None, model: Identified | None = None
    ) -> None:
        from dataclasses import replace

        from r2s2r_cli.engine.rollout import Simulator

        self.robot = robot
        self.settings = settings
        self.model = model or nominal(robot)
        self.theta = self.model.theta
        self.structure = replace(self.model.structure, rod_contact=settings.rod_contact)
        self.simulator = Simulator(self.structure, cache_dir=cache_dir)
        self.cable_caps = tuple((a, b) for a, b in (cable.caps for cable in robot.cables))
        self.period = 1.0 / robot.pid.rate_hz
        self.stride = self._ticks_a_frame()
        self._rested: dict[bytes, tuple[State, float]] = {}

    @property
    def computed_by(self) -> Literal["machine code", "torch"]:
        """What the steps run in."""
        return "machine code" if self.simulator.kernels.native(self.theta.mass) else "torch"

    def rest(self) -> Start:
        """The rest pose of robot.toml: on the ground, all actuated cables extended."""
        return Start("rest", np.array(self.robot.rest_caps_m))

    def settled(self, start: Start) -> tuple[State, float]:
        """The state at rest nearest to a start, and how far its farthest cap moved to get there [m]."""
        import torch

        from r2s2r_cli.engine.settle import settled

        key = start.p_WE.tobytes()
        if key not in self._rested:
            found = settled(
                self.simulator, self.theta, torch.as_tensor(start.p_WE)[None],
                torch.as_tensor(rod_frames(start.p_WE))[None], self.cable_caps, step=self.settings.step_s,
            )  # fmt: skip
            if float(found.speed.max()) > RESTLESS:
                raise NumericalError(
                    "the robot does not come to rest", where="the start of the run", expected="a pose that can be held",
                    received=f"caps still at {1e3 * float(found.speed.max()):.0f} mm/s after {found.spells} looks",
                    hint="r2s2r validate robot.toml",
                )  # fmt: skip
            self._rested[key] = found.state, float(found.shift.max())
        return self._rested[key]

    def closed_loop(self, name: str, policy: Sequence, start: Start, progress: Progress) -> Simulated:
        """Run a policy with the robot's controller. Raises NumericalError, InputError."""
        import torch

        from r2s2r_cli.engine import EngineError
        from r2s2r_cli.engine.closed_loop import closed_loop

        try:
            state, shift = self.settled(start)
            with torch.no_grad():
                run = closed_loop(
                    self.simulator, self.theta, state, self.model.pid, torch.as_tensor(policy.target),
                    torch.as_tensor(policy.hold), torch.as_tensor(policy.timeout), step=self.settings.step_s,
                    tail=self.settings.tail_s, link=self.model.link, progress=progress,
                )  # fmt: skip
        except EngineError as error:
            raise self._translated(name, error, 0.0) from error
        index = run.index[0].clamp(max=len(policy.target) - 1).numpy()
        t = np.arange(len(index)) * self.period
        target, control = policy.target[index], run.u[0].numpy()
        rows = stored_rows(len(index), self.stride)
        at = np.minimum(rows, len(index) - 1)
        # The frame after the last tick is the end: nothing is commanded there any more.
        control_at = np.where((rows == len(index))[:, None], 0.0, control[at])
        return Simulated(
            frames={"t": rows * self.period, **self._read(run.trajectory.states, rows, run.trajectory.substeps)},
            com=centre_of_mass(self.theta, run.trajectory.states, rows),
            commands={"t": t, "target": target, "control": control, "done": run.done[0].numpy()},
            target_at=target[at], control_at=control_at,
            timed_out=tuple(int(k) + 1 for k in torch.nonzero(run.timed_out[0])[:, 0]),
            substeps=run.trajectory.substeps, start_shift=shift,
        )  # fmt: skip

    def replay(self, name: str, replay: Replay, start: Start, progress: Progress) -> Simulated:
        """Run recorded motor commands, from t_first to the first frame at or after t_last. Raises as `closed_loop`."""
        import torch

        from r2s2r_cli.engine import EngineError

        step, every = self.settings.step_s, max(1, round(self.stride * self.period / self.settings.step_s))
        count = math.ceil((replay.t_last - replay.t_first) / (step * every) - 1e-9)
        spell = max(1, round(REPLAY_SPELL_S / (step * every)))
        at = 0.0
        try:
            state, shift = self.settled(start)
            substeps = self.simulator.substeps(self.theta, state, step)
            chunks: list[State] = []
            for first in range(0, count, spell):
                frames = min(spell, count - first)
                at = replay.t_first + first * every * step
                _, control = replay.at(at + step * np.arange(frames * every) - self.model.late)
                with torch.no_grad():
                    run = self.simulator.rollout(
                        self.theta, state, torch.as_tensor(control)[None], step=step, every=every, substeps=substeps
                    )
                state = run.at(frames)
                chunks.append(run.states if not chunks else without_first(run.states))
                progress(first // spell + 1)
        except EngineError as error:
            raise self._translated(name, error, at) from error
        states = joined(chunks)
        rows = np.arange(count + 1)
        t = replay.t_first + rows * every * step
        target_at, control_at = replay.at(t)
        commands = replay.group()
        return Simulated(
            frames={"t": t, **self._read(states, rows, substeps)}, com=centre_of_mass(self.theta, states, rows),
            commands={key: commands[key] for key in commands.datasets}, target_at=target_at, control_at=control_at,
            timed_out=(), substeps=substeps, start_shift=shift,
        )  # fmt: skip

    def _ticks_a_frame(self) -> int:
        """Control ticks from one stored frame to the next. Raises InputError where the step does not fit."""
        whole_steps(self.robot, self.settings.step_s, "simulate.step_s")
        return max(1, round(self.robot.pid.rate_hz / self.settings.frame_rate_hz))

    def _read(self, states: State, rows: np.ndarray, substeps: int) -> dict[str, np.ndarray]:
        h = self.settings.step_s / substeps
        return frame_datasets(self.structure, self.theta, states, rows, self.cable_caps, h=h)

    def _translated(self, name: str, error: Exception, start_s: float) -> Exception:
        """The engine's error in our words."""
        from r2s2r_cli.engine import EngineInputError, NonFiniteError

        if isinstance(error, NonFiniteError):
            return NumericalError(
                f"the simulation of run {name} left the finite numbers",
                where=f"run {name}, {start_s + error.time:g} s, step {error.step}, {error.body}",
                expected="finite numbers", received=error.term,
                hint="r2s2r validate robot.toml",
            )  # fmt: skip
        if isinstance(error, EngineInputError):
            return InputError(f"the engine cannot simulate run {name}: {error.what}", where=error.field,
                              expected=error.expected, received=error.received,
                              hint="r2s2r validate robot.toml")  # fmt: skip
        return error

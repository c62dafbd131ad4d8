"""The simulated trajectory that a loss compares: targets in closed loop, or recorded commands; without a derivative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.segments import Segments, segments, target_intervals

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import LatchedPid, Parameters, Simulator, State


@dataclass(frozen=True)
class World:
    """What does not change during a fit. step: of the engine [s]; timeout: after which the controller gives a target
    up [s]. Frames of a simulation are the controller's ticks, pid.period apart."""

    simulator: Simulator
    pid: LatchedPid
    timeout: float
    step: float = 1e-3

    @property
    def tick_steps(self) -> int:
        """Engine steps in a tick."""
        return round(self.pid.period / self.step)


@dataclass(frozen=True)
class Flight:
    """One simulation. t: ticks from 0 [s], (tick,). states: flat, (tick, NS). commands: (row, actuated), each row held
    for `hold` engine steps. target, control: at the ticks, (tick, actuated); segments: None in command replay, where
    they are those of the real run. timed_out: numbers of the targets given up, 1-based. start: the first state."""

    t: np.ndarray
    states: Tensor
    commands: Tensor
    hold: int
    substeps: int
    target: np.ndarray
    control: np.ndarray
    segments: Segments | None
    timed_out: tuple[int, ...]
    start: State


def fly(world: World, theta: Parameters, start: State, targets: np.ndarray) -> Flight:
    """Run targets (S, actuated) with the robot's controller. Raises EngineInputError, NonFiniteError."""
    return fly_side_by_side(world, theta, start, targets)[0]


def fly_side_by_side(world: World, theta: Parameters, start: State, targets: np.ndarray) -> list[Flight]:
    """The same for each parameter set of a batch; those that are through first are cut where they ended."""
    import torch

    from r2s2r_cli.engine import closed_loop, pack_state

    count, structure = len(targets), world.simulator.structure
    with torch.no_grad():
        run = closed_loop(
            world.simulator, theta, start, world.pid, torch.as_tensor(targets),
            torch.zeros(count, dtype=torch.float64), torch.full((count,), world.timeout, dtype=torch.float64),
            step=world.step,
        )  # fmt: skip
    states = pack_state(structure, run.trajectory.states, leading=2)
    made = []
    for b, ticks in enumerate(run.ticks.tolist()):
        u = run.u[b, :ticks]
        # The frame after the last tick is the end of the last target: nothing is commanded there any more.
        control = np.vstack([u.numpy(), np.zeros(u.shape[1])])
        index = np.append(run.index[b, :ticks].numpy(), count - 1)
        t, target = np.arange(len(index)) * world.pid.period, targets[index]
        given_up = tuple(int(k) + 1 for k in torch.nonzero(run.timed_out[b])[:, 0])
        made.append(Flight(
            t=t, states=states[b, : ticks + 1], commands=u, hold=world.tick_steps, substeps=run.trajectory.substeps,
            target=target, control=control, segments=segments(target_intervals(t, target, control=control), t, control),
            timed_out=given_up, start=start,
        ))  # fmt: skip
    return made


def replay(
    world: World, theta: Parameters, start: State, t_command: np.ndarray, control: np.ndarray, seconds: float
) -> Flight:
    """Replay commands: rows `control` (row, actuated), each from t_command (row,) [s] until the next; the first also
    before it. Raises EngineInputError, NonFiniteError."""
    import torch

    from r2s2r_cli.engine import pack_state

    ticks = max(1, int(np.ceil(seconds / world.pid.period - 1e-9)))
    steps = ticks * world.tick_steps
    u = torch.as_tensor(commands_at(t_command, control, np.arange(steps) * world.step))
    structure = world.simulator.structure
    with torch.no_grad():
        run = world.simulator.rollout(theta, start, u[None], step=world.step, every=world.tick_steps)
    t = np.arange(ticks + 1) * world.pid.period
    return Flight(
        t=t, states=pack_state(structure, run.states, leading=2)[0], commands=u, hold=1, substeps=run.substeps,
        target=np.full((ticks + 1, control.shape[1]), np.nan), control=commands_at(t_command, control, t),
        segments=None, timed_out=(), start=start,
    )  # fmt: skip


def commands_at(t_command: np.ndarray, control: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The command that holds at each of the times t [s], (len(t), actuated)."""
    row = np.searchsorted(t_command, t + 1e-9, side="right") - 1
    return np.asarray(control[row.clip(min=0)])

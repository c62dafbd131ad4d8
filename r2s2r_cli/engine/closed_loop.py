"""Closed loop: the robot's controller inside the simulation, one tick of it at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from r2s2r_cli.engine.batch import common_batch, tensors_of
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.late import delay_of, sense
from r2s2r_cli.engine.link import Link
from r2s2r_cli.engine.nonfinite import require_finite
from r2s2r_cli.engine.parameters import Parameters, check_parameters
from r2s2r_cli.engine.pid import LatchedPid, advance, start_progress, steps_a_tick, ticks
from r2s2r_cli.engine.reading import cap_lengths
from r2s2r_cli.engine.rollout import Simulator
from r2s2r_cli.engine.state import State, check_state, end_caps
from r2s2r_cli.engine.structure import Structure
from r2s2r_cli.engine.trajectory import Trajectory


@dataclass(frozen=True)
class ClosedLoopRun:
    """One policy, executed. Frames of the trajectory are the control ticks, and the end.

    u: motor commands as sent, (B, tick, actuated); index: number of the target at each tick, S where the policy is
    through, (B, tick); done: latched, after the tick, (B, tick, actuated); length: of all cables as the controller
    read them [m], (B, tick, cable); ticks: how many each environment needed, (B,); timed_out: targets given up, (B, S).
    """

    trajectory: Trajectory
    u: Tensor
    index: Tensor
    done: Tensor
    length: Tensor
    ticks: Tensor
    timed_out: Tensor

    def duration(self, period: float) -> Tensor:
        """Time until the last target was reached or given up [s], (B,)."""
        return self.ticks.to(self.u.dtype) * period


def closed_loop(
    simulator: Simulator,
    theta: Parameters,
    state0: State,
    pid: LatchedPid,
    targets: Tensor,
    holds: Tensor,
    timeouts: Tensor,
    *,
    step: float = 1e-3,
    tail: float = 0.0,
    link: Link | None = None,
    progress: Callable[[int], None] | None = None,
) -> ClosedLoopRun:
    """Run a policy from state0 (frame G): targets (S, actuated) in positions, holds and timeouts (S,) [s].

    step: engine step [s], must divide the controller's period. tail: what is simulated after the last target [s].
    link: delay of the commands, and those sent before the controller took over; None: neither.
    progress: called at every tick with the number of targets that all environments are through. Differentiable in
    everything but the decisions (`done`, the times of transitions). Environments that are through wait for the others,
    motors off.
    Raises EngineInputError, NonFiniteError.
    """
    structure = simulator.structure
    check_parameters(structure, theta)
    check_state(structure, state0)
    _check_policy(structure, targets, holds, timeouts)
    if (tuple(pid.actuated), len(pid.cable_caps)) != (tuple(structure.actuated), structure.n_cables):
        raise EngineInputError(
            "pid.actuated", "the controller of another robot",
            expected=f"motors of cables {structure.actuated} of {structure.n_cables}",
            received=f"{pid.actuated} of {len(pid.cable_caps)}",
        )  # fmt: skip
    if not (math.isfinite(tail) and tail >= 0):
        raise EngineInputError("tail", "no time to wait", expected="0 s or more, finite", received=f"{tail:g} s")
    late = delay_of(structure, theta)
    if late is not None:
        given = Link() if link is None else link
        link = replace(given, delay=torch.as_tensor(given.delay).to(late) + late)
    linked = {} if link is None else link.tensors(state0.p_WB)
    batch = common_batch({**tensors_of(state0), **tensors_of(theta), **linked})
    whole = steps_a_tick(pid.period, step)
    n = simulator.substeps(theta, state0, step)
    h, count = step / n, whole * n
    wide = effective(structure, theta).map(lambda x: x.expand(batch, *x.shape[1:]))
    p, s = pack_parameters(structure, theta), pack_state(structure, state0).expand(batch, -1)
    hold_ticks, timeout_ticks = ticks(holds, pid.period), ticks(timeouts, pid.period)
    tail_ticks = round(tail / pid.period)
    most = int((hold_ticks + timeout_ticks).sum()) + tail_ticks + len(targets)

    at = start_progress(batch, s.device)
    memory = pid.start(s.new_zeros(batch, structure.n_cables))
    given_up = torch.zeros(batch, len(targets), dtype=torch.bool, device=s.device)
    needed = torch.zeros(batch, dtype=torch.long, device=s.device)
    frames, us, indices, dones, lengths = [s], list[Tensor](), list[Tensor](), list[Tensor](), list[Tensor]()
    arrived = list[Tensor]()
    line = None if link is None else link.line(batch, s[:, : structure.n_actuated], pid.period, whole)
    most += 0 if line is None else int(line.lead.max())
    after = 0
    for tick in range(most):
        state = unpack_state(structure, s)
        length = cap_lengths(pid.cable_caps, end_caps(wide, state))
        length = sense(structure, wide, length, tick * pid.period)
        running = ~at.finished(len(targets))
        u, memory = pid.tick(memory, length, at.target(targets))
        u = torch.where(running[:, None], u, torch.zeros_like(u))
        before, (at, moved) = at, advance(at, memory.done, hold_ticks, timeout_ticks)
        changed = moved.changed
        if line is not None and bool((tick < line.lead).any()):
            # The controller has not taken over yet: it starts afresh at the next tick.
            early = tick < line.lead
            u = torch.where(early[:, None], line.given(tick), u)
            at, moved = at.held_back(before, early), moved.held_back(early)
            running, changed = running & ~early, moved.changed | early
        us.append(u)
        indices.append(before.index)
        dones.append(memory.done)
        lengths.append(length)
        given_up[moved.timed_out, before.index[moved.timed_out]] = True
        memory = memory.restarted(changed)
        needed = needed + running.long()
        if line is None:
            s = simulator.advance(s, u[:, None], p, h=h, hold=count, every=count)[:, -1]
        else:
            rows, line = line.pushed(u)
            s = simulator.advance(s, rows, p, h=h, hold=n, every=count)[:, -1]
            arrived.append(rows)
        frames.append(s)
        if not bool(torch.isfinite(s.detach()).all()):
            break  # named below; a number that is none never reaches a target
        if progress is not None:
            progress(int(at.index.min()))
        if bool(at.finished(len(targets)).all()):
            after += 1
            if after > tail_ticks:
                break
    flat, commands = torch.stack(frames, dim=1), torch.stack(us, dim=1)
    plain = (flat.detach(), (torch.cat(arrived, dim=1) if arrived else commands).detach(), p.detach())
    require_finite(structure, simulator.kernels.fn, *plain, h=h, hold=n if arrived else count, every=count)
    t = torch.arange(flat.shape[1], dtype=flat.dtype, device=flat.device) * pid.period
    trajectory = Trajectory(structure, theta, t, unpack_state(structure, flat), step, n)
    return ClosedLoopRun(
        trajectory, commands, torch.stack(indices, dim=1), torch.stack(dones, dim=1), torch.stack(lengths, dim=1),
        needed, given_up,
    )  # fmt: skip


def _check_policy(structure: Structure, targets: Tensor, holds: Tensor, timeouts: Tensor) -> None:
    """Raises EngineInputError for targets of another robot, that are no numbers, or times that do not fit them."""
    if targets.ndim != 2 or targets.shape[1] != structure.n_actuated or not len(targets):
        raise EngineInputError("targets", "wrong shape", expected=f"(S, {structure.n_actuated}), S at least 1",
                               received=str(tuple(targets.shape)))  # fmt: skip
    bad = torch.nonzero(~torch.isfinite(targets))
    if len(bad):
        row, column = bad[0].tolist()
        raise EngineInputError(f"targets.{row}.{column}", "not a finite number", expected="finite numbers",
                               received=str(float(targets[row, column])))  # fmt: skip
    for name, times in (("holds", holds), ("timeouts", timeouts)):
        if times.shape != (len(targets),):
            raise EngineInputError(name, "wrong shape", expected=f"({len(targets)},), one a target",
                                   received=str(tuple(times.shape)))  # fmt: skip

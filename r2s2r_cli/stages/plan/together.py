"""The loop of `engine.closed_loop`, tick by tick, for many robots at once; finished environments leave the batch."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.plan.standing import Executed, Standing, tracks

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine.link import DelayLine
    from r2s2r_cli.stages.plan.executor import Executor

STALL_S, STALL_M = 0.2, 2e-4
"""A target whose cables move less than this [m] in that time [s] is not reached any more: a winch is at its end."""


def run_together(executor: Executor, at: Standing, targets: Tensor, counts: np.ndarray, *, record: bool) -> Executed:
    """Targets (B, S, actuated) from where the robots stand, with the robot's controller.

    counts: how many of its targets each is to reach, (B,). record: keep every tick. The batch is cut down whenever an
    eighth of it has ended.
    """
    import torch

    from r2s2r_cli.engine.flat import unpack_state
    from r2s2r_cli.engine.late import sense
    from r2s2r_cli.engine.pid import advance, start_progress
    from r2s2r_cli.engine.reading import cap_lengths
    from r2s2r_cli.engine.state import end_caps

    batch, steps, _ = targets.shape
    ends_s = at.s[:, None].repeat(1, steps, 1)
    ends_line = at.line[:, None].repeat(1, steps, 1, 1)
    ends_t = at.t[:, None].repeat(1, steps)
    ticks, given_up = np.zeros((batch, steps), dtype=np.int64), np.zeros((batch, steps), dtype=bool)
    failed = np.zeros(batch, dtype=bool)
    hold, timeout = torch.zeros(steps, dtype=torch.long), torch.full((steps,), executor.timeout)
    n = executor.substeps(at)
    h, count = executor.step / n, executor.whole * n
    delayed = bool((executor.delay > 0).any())
    kept: list[tuple[Tensor, ...]] = []

    live = torch.arange(batch)
    s, s_line, draw, t, goal, asked = at.s, at.line, at.draw, at.t, targets, torch.as_tensor(counts)
    theta, p, pid = executor.numbers(draw)
    memory, where = pid.start(s.new_zeros(batch, executor.structure.n_cables)), start_progress(batch)
    line = _line(executor, draw, s_line) if delayed else None
    stall, length_then = max(1, round(STALL_S / executor.period)), s.new_zeros(batch, executor.structure.n_actuated)
    with torch.no_grad():
        for tick in range(1, steps * (executor.timeout + 1) + 1):
            state = unpack_state(executor.structure, s)
            length = cap_lengths(executor.cable_caps, end_caps(theta, state)) + executor.bias[draw]
            length = sense(executor.structure, theta, length, t[:, None] + (tick - 1) * executor.period)
            running = where.index < asked
            wanted = goal[torch.arange(len(s)), where.index.clamp(max=steps - 1)]
            u, memory = pid.tick(memory, length, wanted)
            u = torch.where(running[:, None], u, torch.zeros_like(u))
            before, done = where.index, memory.done
            where, moved = advance(where, memory.done, hold, timeout)
            memory = memory.restarted(moved.changed)
            if line is None:
                s = executor.simulator.advance(s, u[:, None], p, h=h, hold=count, every=count)[:, -1]
            else:
                rows, line = line.pushed(u)
                s = executor.simulator.advance(s, rows, p, h=h, hold=n, every=count)[:, -1]
                s_line = torch.cat([s_line[:, 1:], u[:, None]], dim=1)
            sane = torch.isfinite(s).all(dim=1)
            changed = moved.changed & running
            if bool(changed.any()):
                left, step_of = live[changed], before[changed]
                ends_s[left, step_of], ticks[left.numpy(), step_of.numpy()] = s[changed], tick
                ends_line[left, step_of], ends_t[left, step_of] = s_line[changed], t[changed] + tick * executor.period
                given_up[left.numpy(), step_of.numpy()] = moved.timed_out[changed].numpy()
            if record:
                kept.append((live[running], s[running], u[running], before[running], done[running]))
            over = (where.index >= asked) | ~sane
            if executor.hurried and tick % stall == 0:
                now = length[:, list(executor.structure.actuated)]
                still = (torch.where(memory.done, 0.0, now - length_then).abs() < STALL_M).all(dim=1)
                stalled = still & (where.elapsed > stall) & ~over
                given_up[live[stalled].numpy(), where.index[stalled].numpy()] = True
                over, length_then = over | stalled, now
            if executor.hurried:
                over = over | moved.timed_out
            failed[live[~sane].numpy()] = True
            if bool(over.all()):
                break
            if int(over.sum()) * 8 >= len(over):
                keep = ~over
                live, s, s_line, draw, t = live[keep], s[keep], s_line[keep], draw[keep], t[keep]
                goal, asked, length_then = goal[keep], asked[keep], length_then[keep]
                theta, p, pid = executor.numbers(draw)
                memory = replace(memory, total=memory.total[keep], previous=memory.previous[keep],
                                 done=memory.done[keep])  # fmt: skip
                where = replace(where, index=where.index[keep], elapsed=where.elapsed[keep], held=where.held[keep])
                line = None if line is None else _line(executor, draw, s_line)
    ends = tuple(Standing(ends_s[:, k], ends_line[:, k], at.draw, ends_t[:, k]) for k in range(steps))
    return Executed(ends, ticks, given_up, failed, counts, tuple(tracks(at.s, kept)) if record else ())


def _line(executor: Executor, draw: Tensor, recent: Tensor) -> DelayLine:
    """The commands under way as the engine's link takes them."""
    from r2s2r_cli.engine.link import Link

    made = Link(delay=executor.delay[draw][:, None]).line(len(draw), recent[:, 0], executor.period, executor.whole)
    depth = made.recent.shape[1]
    return replace(made, recent=recent[:, recent.shape[1] - depth :])

"""Adjoints of a rollout by the backward kernel, over states that were recorded or are made again from checkpoints."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from r2s2r_cli.engine.native.build import Builder, Kernel
from r2s2r_cli.engine.native.lanes import address, from_lanes, to_lanes
from r2s2r_cli.engine.native.schedule import Schedule, given_arrays, lanes_for
from r2s2r_cli.engine.native.threads import spread

CHUNK = 256
"""Steps between checkpoints of a backward pass that would need more than STATES bytes for all its states."""

STATES = 32 * 2**20
"""Bytes of states that a backward pass may keep per thread and block of lanes."""


def run_backward(
    builder: Builder, s0: Tensor, u: Tensor, p: Tensor, g_frames: Tensor, plan: Schedule, record: Tensor | None
) -> tuple[Tensor, Tensor, Tensor]:
    """Adjoints of s0 (B, NS), u (B, K, NU) and p (B, NP), each of its shape, for adjoints g_frames (B, F, NS).

    record: states of all steps by block, as `run_forward` gives them with `every` 1; None: they are made again, with
    memory bounded. Raises TracingError.
    """
    batch, rows = u.shape[:2]
    lanes = lanes_for(batch, s0.dtype)
    backward = builder.kernel(Kernel("backward", s0.dtype, lanes))
    state, inputs, parameters, step = given_arrays(s0, u, p, plan, lanes)
    seeds = to_lanes(g_frames, lanes)
    adjoint = torch.zeros_like(state)
    g_inputs, g_parameters = torch.zeros_like(inputs), torch.zeros_like(parameters)
    n = plan.steps(rows)

    def back(block: int, states: Tensor, start: int, end: int) -> None:
        """Adjoints through steps start to end, whose states are given."""
        arrays = (inputs, parameters), (adjoint, seeds, g_inputs, g_parameters)
        (u0, p0), rest = ([address(x, block) for x in group] for group in arrays)
        backward(states.data_ptr(), u0, p0, step.data_ptr(), *rest, start, end, plan.hold, plan.every)

    def run(block: int) -> None:
        if record is not None and n:
            back(block, record[block], 0, n)
        else:
            given = (address(inputs, block), address(parameters, block), step.data_ptr())
            for states, start, end in _stretches(builder, state[block], given, n, plan.hold):
                back(block, states, start, end)
        adjoint[block] += seeds[block, 0]

    spread(run, range(len(state)), plan.threads)
    return from_lanes(adjoint, batch), from_lanes(g_inputs, batch), from_lanes(g_parameters, batch)


def _stretches(
    builder: Builder, state: Tensor, given: tuple[int, int, int], n: int, hold: int
) -> Iterator[tuple[Tensor, int, int]]:
    """The states of all steps of one block, in stretches from the last to the first: (states, start, end)."""
    forward = builder.kernel(Kernel("forward", state.dtype, state.shape[-1]))
    size = state.numel() * state.element_size()
    chunk = n if n * size <= STATES else CHUNK
    starts = list(range(0, n, max(chunk, 1)))
    marks = state.new_empty((len(starts), *state.shape))
    now = state.clone()
    for k, start in enumerate(starts):
        marks[k] = now
        if k + 1 < len(starts):
            # `every` beyond the rollout: no frame is written.
            forward(now.data_ptr(), 0, *given, start, start + chunk, hold, n + 1)
    states = state.new_empty((min(chunk, n) + 1, *state.shape))
    for k, start in reversed(list(enumerate(starts))):
        end = min(start + chunk, n)
        states[0] = marks[k]
        now.copy_(marks[k])
        if end - start > 1:
            # The state after step t is frame t + 1, and belongs in place t + 1 - start.
            forward(now.data_ptr(), states.data_ptr() - start * size, *given, start, end - 1, hold, 1)
        yield states, start, end

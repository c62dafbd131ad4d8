"""Frames and their tangents by the tangent kernel: one environment a call, its directions in the lanes."""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.engine.native import machine
from r2s2r_cli.engine.native.build import Builder, Kernel
from r2s2r_cli.engine.native.program import Active
from r2s2r_cli.engine.native.schedule import Schedule, given_arrays
from r2s2r_cli.engine.native.threads import spread


def run_tangent(
    builder: Builder,
    s0: Tensor,
    u: Tensor,
    p: Tensor,
    tangents: tuple[Tensor, Tensor, Tensor],
    kinds: Active,
    plan: Schedule,
) -> tuple[Tensor, Tensor]:
    """Frames (B, F, NS) and their tangents (B, F, NS, D), for tangents (B, NS, D), (B, K, NU, D), (B, active, D).

    kinds: which of them may be other than zero; the kernel is made for these. Raises TracingError.
    """
    (batch, rows), directions = u.shape[:2], tangents[0].shape[-1]
    base = machine.vector_bytes() // s0.element_size()
    lanes = base if directions <= base else 2 * base
    kernel = builder.kernel(Kernel("tangent", s0.dtype, lanes, kinds))
    state, inputs, parameters, step = given_arrays(s0, u, p, plan, 1)
    passes = -(-directions // lanes)
    ds, du, dp = (torch.nn.functional.pad(x, (0, passes * lanes - directions)) for x in tangents)
    frames = s0.new_empty((batch, plan.frames(rows), s0.shape[1]))
    frames[:, 0] = s0.detach()
    d_frames = s0.new_empty((*frames.shape, passes * lanes))
    n = plan.steps(rows)

    def run(task: int) -> None:
        k, part = divmod(task, passes)
        chosen = slice(part * lanes, (part + 1) * lanes)
        d_state, d_inputs, d_parameters = (
            x[k, ..., chosen].clone(memory_format=torch.contiguous_format) for x in (ds, du, dp)
        )
        now = state[k].clone()
        tangent_frames = d_frames.new_empty((*frames.shape[1:], lanes))
        tangent_frames[0] = d_state
        if n:
            arrays = (now, d_state, frames[k], tangent_frames, inputs[k], d_inputs, parameters[k], d_parameters, step)
            kernel(*(x.data_ptr() for x in arrays), 0, n, plan.hold, plan.every)
        d_frames[k, ..., chosen] = tangent_frames

    spread(run, range(batch * passes), plan.threads)
    return frames, d_frames[..., :directions]

"""Rollouts that torch differentiates: in reverse by the backward kernel, forward by the tangent kernel."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from r2s2r_cli.engine.native.step import NativeStep


def rollout(
    step: NativeStep, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int = 1, every: int = 1, threads: int = 1
) -> Tensor:
    """Frames (B, F, NS); see NativeStep.forward. Differentiable once, in reverse and in forward mode."""
    if not step.native(s0):
        return step.torch_rollout(s0, u, p, h=h, hold=hold, every=every)
    options = {"h": h, "hold": hold, "every": every, "threads": threads}
    frames: Tensor = _Rollout.apply(s0, u, p, step, options)
    return frames


class _Rollout(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, s0: Tensor, u: Tensor, p: Tensor, step: NativeStep, options: dict[str, Any]) -> Tensor:
        ctx.save_for_backward(s0, u, p)
        ctx.save_for_forward(s0, u, p)
        ctx.step, ctx.options = step, options
        if any(ctx.needs_input_grad):
            frames, ctx.states = step.recorded(s0, u, p, **options)
        else:
            frames = step.forward(s0, u, p, **options)
        # A tensor of its own: forward mode allows no view here.
        return frames.clone(memory_format=torch.contiguous_format)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, g_frames: Tensor) -> tuple[Any, ...]:
        s0, u, p = ctx.saved_tensors
        return (*ctx.step.vjp(s0, u, p, g_frames, states=ctx.states, **ctx.options), None, None)

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Tensor:
        s0, u, p = ctx.saved_tensors
        ds0, du, dp = (None if x is None else x[..., None] for x in tangents[:3])
        _, d_frames = ctx.step.jvp(s0, u, p, ds0=ds0, du=du, dp=dp, **ctx.options)
        return d_frames[..., 0].contiguous()

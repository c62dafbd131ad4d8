"""The same rollouts in plain torch: the reference, and what runs where kernels cannot."""

from __future__ import annotations

import warnings

import torch
from torch import Tensor
from torch.autograd import forward_ad

from r2s2r_cli.engine.native import machine
from r2s2r_cli.engine.native.symbolic import StepFn


class NativeFallbackWarning(RuntimeWarning):
    """Rollouts run in plain torch, much slower than compiled; given once a process."""


_warned = False


def runs_native(s0: Tensor) -> bool:
    """Whether kernels can run from this state; warns once if not."""
    global _warned  # one warning a process, whatever the warning filters are
    reason = (
        f"the tensors are on {s0.device}"
        if s0.device.type != "cpu"
        else "llvmlite cannot be loaded"
        if not machine.available()
        else None
    )
    if reason and not _warned:
        _warned = True
        warnings.warn(f"{reason}: rollouts run in plain torch, not compiled", NativeFallbackWarning, stacklevel=4)
    return reason is None


def rollout(fn: StepFn, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int, every: int) -> Tensor:
    """Frames (B, F, NS); see NativeStep.forward. Differentiable."""
    step = s0.new_full((len(s0), 1), h)
    state, frames = s0, [s0]
    for t in range(u.shape[1] * hold):
        state = fn(state, u[:, t // hold], p, step)
        if (t + 1) % every == 0:
            frames.append(state)
    return torch.stack(frames, dim=1)


def vjp(
    fn: StepFn, s0: Tensor, u: Tensor, p: Tensor, g_frames: Tensor, *, h: float, hold: int, every: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Adjoints of s0, u and p by autograd; see NativeStep.vjp."""
    inputs = [x.detach().clone().requires_grad_() for x in (s0, u, p)]
    with torch.enable_grad():
        frames = rollout(fn, inputs[0], inputs[1], inputs[2], h=h, hold=hold, every=every)
    grads = torch.autograd.grad(frames, inputs, g_frames, allow_unused=True, materialize_grads=True)
    return grads[0], grads[1], grads[2]


def jvp(
    fn: StepFn,
    s0: Tensor,
    u: Tensor,
    p: Tensor,
    tangents: tuple[Tensor, Tensor, Tensor],
    active: tuple[int, ...] | None,
    *,
    h: float,
    hold: int,
    every: int,
) -> tuple[Tensor, Tensor]:
    """Frames and their tangents by forward mode, one direction after the other; see NativeStep.jvp."""
    ds0, du, dp = tangents
    if active is not None:
        kept = torch.zeros(dp.shape[1], dtype=dp.dtype, device=dp.device)
        kept[list(active)] = 1.0
        dp = dp * kept[:, None]
    columns = []
    with warnings.catch_warnings():
        # The first dual tensor makes torch load its own scripted code, of which it warns.
        warnings.filterwarnings("ignore", "`torch.jit.script` is", DeprecationWarning)
        for k in range(ds0.shape[-1]):
            with forward_ad.dual_level():
                pairs = ((s0, ds0[..., k]), (u, du[..., k]), (p, dp[..., k]))
                a, b, c = (forward_ad.make_dual(x.detach().clone(), dx.clone()) for x, dx in pairs)
                frames, tangent = forward_ad.unpack_dual(rollout(fn, a, b, c, h=h, hold=hold, every=every))
                columns.append(torch.zeros_like(frames) if tangent is None else tangent)
    return frames, torch.stack(columns, dim=-1)

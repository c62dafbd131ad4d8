"""Commands that reach the winches late (hook `delay`), and what cameras and sensors make of a trajectory.

A delay is no state of the step: it shifts the commands before the step sees them, exactly, and differentiably.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.engine.hooks import overrides
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


def delay_of(structure: Structure, theta: Parameters) -> Tensor | None:
    """Time from a command to the winches [s], (B, 1); None where no effect has a say in it."""
    delays = [effect.delay(theta.of(effect.name)) for effect in overrides(structure, "delay")]
    known = [delay for delay in delays if delay is not None]
    return sum(known[1:], known[0]) if known else None


def shifted(commands: Tensor, delay: Tensor, row: float) -> tuple[Tensor, Tensor]:
    """Commands (B, K, A) in rows of `row` seconds as they arrive `delay` (B, 1) [s] later, 0 before the first; and
    their derivatives by the delay, (B, K, A). A row holds the mean of what arrives within it."""
    batch, rows = max(len(commands), len(delay)), commands.shape[1]
    u = torch.nn.functional.pad(commands.expand(batch, -1, -1), (0, 0, rows + 1, 0))
    late = torch.clamp(delay.expand(batch, 1) / row, 0.0, float(rows))
    whole = torch.floor(late.detach() + 1e-9)
    share = torch.clamp(late - whole, min=0.0)[..., None]
    at = torch.arange(rows, device=u.device) + rows + 1 - whole.to(torch.long)
    environment = torch.arange(batch, device=u.device)[:, None]
    new, old = u[environment, at], u[environment, at - 1]
    return (1.0 - share) * new + share * old, (old - new) / row


def sense(structure: Structure, theta: Parameters, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
    """Cable lengths (..., cable) [m] as the sensors read them at times t [s] of the run, a number or (..., 1): effects
    of channel sensing. theta: batch of 1, or the first axis of `length`."""
    for effect in overrides(structure, "sensing"):
        length = effect.sensing(theta.of(effect.name), length, t)
    return length


def observe(structure: Structure, theta: Parameters, t: Tensor, p_WE: Tensor) -> Tensor:
    """End caps (B, frame, cap, 3) [m] as the camera sees them at times t (frame,) [s] of the run: effects of channel
    observation. NaN where a cap is not seen. Frames 5 to 10 ms apart: a delay is interpolated between them, and before
    the first one nothing moved."""
    for effect in overrides(structure, "observation"):
        p_WE = effect.observation(theta.of(effect.name), t, p_WE)
    return p_WE


def unseen(structure: Structure, theta: Parameters, p_WE: Tensor) -> Tensor:
    """Where end caps (B, cap, 3) [m] are that a camera sees at p_WE: the inverse of `observe` for effects that move all
    points by one affine law (camera pose and scale). What shifts in time, or loses caps, is left as it is."""
    if not overrides(structure, "observation"):
        return p_WE
    basis = torch.cat([torch.zeros_like(p_WE[:1, :1]), torch.eye(3, dtype=p_WE.dtype, device=p_WE.device)[None]], dim=1)
    now = torch.zeros(1, dtype=p_WE.dtype, device=p_WE.device)
    # A single frame at a time of its own: nothing to interpolate. Every point as both caps of a rod: taken for each
    # other they are what they were.
    points = basis[0, :, None, None].expand(-1, 1, 2, -1)
    shown = torch.cat([observe(structure, theta, now, point[None])[:, 0, :1] for point in points], dim=1)
    shift, turn = shown[:, :1], (shown[:, 1:] - shown[:, :1]).mT
    known = torch.isfinite(turn).all()
    return torch.linalg.solve(turn[:, None], (p_WE - shift)[..., None])[..., 0] if bool(known) else p_WE

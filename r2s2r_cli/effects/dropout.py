"""Lost and mistaken end caps.

What it is: the tracker does not see a cap for a frame, or takes the two caps of a rod for each other.
Where it acts: channel observation; caps are missing (NaN), rods turned round, in frames that a fixed sequence of the
frame's time chooses: no simulation draws anything, and a higher rate adds frames to those of a lower one.
Parameters: lost, share of the caps that are missing; swapped, share of the rods with caps exchanged.
What it looks like in data: gaps, and single frames that are off by a rod's length.
What it is confused with: nothing: single frames, not motion.
Source: occlusion and colour segmentation.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class Dropout(Effect):
    """Caps missing in some frames, exchanged in others."""

    name = "dropout"
    channel = Channel.OBSERVATION
    title = "lost and mistaken end caps"
    own = (
        EffectParameter("lost", "1", 0.0, 0.5, off=0.0, scale=0.1, what="share of caps that are missing", fitted=False),
        EffectParameter(
            "swapped", "1", 0.0, 0.3, off=0.0, scale=0.03, what="share of rods with caps exchanged", fitted=False
        ),
    )
    look_alikes = ()

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "caps are missing, or single frames are off by a rod's length"

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """With gaps and exchanged caps."""
        caps = p_WE.shape[2]
        number = torch.arange(caps, dtype=t.dtype, device=t.device)
        rod = _chance(t, 100.0 + number[::2])[None].repeat_interleave(2, dim=-1)
        around = p_WE.unflatten(2, (-1, 2)).flip(3).flatten(2, 3)
        seen = torch.where((rod < x["swapped"][..., None])[..., None], around, p_WE)
        # The first cap has another number than 0, which at 0 s is a certain loss.
        lost = _chance(t, torch.where(number > 0, number, float(caps)))[None] < x["lost"][..., None]
        return torch.where(lost[..., None], torch.full_like(seen, torch.nan), seen)


def _chance(t: Tensor, number: Tensor) -> Tensor:
    """Numbers in [0, 1) that look drawn, (frame, number): the same whenever asked for the same time [s]."""
    mixed = torch.sin(t[:, None] * 12.9898 + number * 78.233) * 43758.5453
    return mixed - torch.floor(mixed)

"""Drag of a tether.

What it is: a cable to a power supply or a safety line pulls the robot towards its anchor.
Where it acts: channel world; a force of constant size towards a fixed point, at the centre of mass of its rod.
Parameters: force_n of each rod; anchor_x_m, anchor_y_m, anchor_z_m, place of the anchor.
What it looks like in data: a drift towards one point of the room, whose direction turns as the robot moves on; the rod
leads the others.
What it is confused with: ground_slope (whose direction stays, and which pulls all rods alike), payload.
Source: statics.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values, WorldTerms

NEAR = 0.02
"""[m] closer than this to its anchor a tether is slack."""


class TetherDrag(Effect):
    """A force towards a fixed point."""

    name = "tether_drag"
    channel = Channel.WORLD
    title = "drag of a tether"
    own = (
        EffectParameter("force_n", "N", 0.0, 0.5, off=0.0, scale=0.15, what="of the tether", per="rod"),
        EffectParameter("anchor_x_m", "m", -3.0, 3.0, off=1.0, scale=1.0, only_shape=True, what="of the anchor"),
        EffectParameter("anchor_y_m", "m", -3.0, 3.0, off=0.0, scale=1.0, only_shape=True, what="of the anchor"),
        EffectParameter("anchor_z_m", "m", 0.0, 3.0, off=0.5, scale=0.5, only_shape=True, what="of the anchor"),
    )
    look_alikes = ("ground_slope",)

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "drift towards one point of the room, one rod ahead, whatever the gait"

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """The pull on every rod."""
        anchor = torch.stack([x["anchor_x_m"], x["anchor_y_m"], x["anchor_z_m"]], dim=-1)
        way = anchor - terms.p_GB
        distance = torch.sqrt((way * way).sum(-1, keepdim=True) + NEAR * NEAR)
        return force + x["force_n"][..., None] * way / distance, torque

"""Drag of the air.

What it is: the air, or whatever else damps a motion that touches nothing, brakes the rods.
Where it acts: channel world; force and torque against velocity and turning of every rod, as if the drag sat where its
mass does: free motion dies away at the rate drag / mass, whatever its form.
Parameters: drag_n_s_per_m, of a rod.
What it looks like in data: whatever is fast is slower, above all tip-overs; what creeps is as it was.
What it is confused with: viscous_contact (only of what touches the ground), stribeck.
Source: linear damping in proportion to mass (Rayleigh).
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values, WorldTerms


class AirDrag(Effect):
    """A force and a torque against every motion."""

    name = "air_drag"
    channel = Channel.WORLD
    title = "drag of the air"
    own = (EffectParameter("drag_n_s_per_m", "N s/m", 0.0, 2.0, off=0.0, scale=0.3, what="of a rod"),)
    look_alikes = ("viscous_contact", "stribeck")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "tip-overs and other fast motions are slower, slow ones as they were"

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Against both velocities of every rod."""
        drag = x["drag_n_s_per_m"][..., None]
        inertia = 1.0 / torch.diagonal(terms.inverse_inertia, dim1=-2, dim2=-1)
        return force - drag * terms.v_GB, torque - drag * terms.inverse_mass * inertia * terms.w_R

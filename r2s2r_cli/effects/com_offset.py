"""Centre of mass off the middle.

What it is: motors, battery or wires sit further along a rod than the model has them.
Where it acts: channel mass; the centre of mass of each rod moves along its axis, the inertia about it stays.
Parameters: axial_m, + towards the odd cap, one a rod. Offsets across the axis are within the cap radius and left out.
What it looks like in data: the robot tips over early or late, at the same rod in every cycle.
What it is confused with: payload (which is heavier as well), camera_delay.
Source: rigid-body mechanics.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, MassTerms, Values


class ComOffset(Effect):
    """The centre of mass of each rod moved along its axis."""

    name = "com_offset"
    channel = Channel.MASS
    title = "centre of mass off the middle"
    own = (EffectParameter("axial_m", "m", -0.03, 0.03, off=0.0, scale=0.01, what="along the rod's axis", per="rod"),)
    look_alikes = ("payload", "camera_delay")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "tips over early or late at the same rod in every cycle"

    def mass(self, x: Values, terms: MassTerms) -> MassTerms:
        """The centre shifted."""
        zero = torch.zeros_like(x["axial_m"])
        return replace(terms, centre=terms.centre + torch.stack([zero, zero, x["axial_m"]], dim=-1))

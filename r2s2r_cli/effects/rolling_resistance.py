"""Rolling and torsional resistance of the caps.

What it is: rubber caps and soft floors resist rolling and turning on the spot.
Where it acts: channel contact; a torque against the rod's angular velocity of at most `rolling_m` (about horizontal
axes) and `torsion_m` (about the vertical) times the normal force of the step before, and never more than stops it.
Parameters: rolling_m, torsion_m, arms of the normal force.
What it looks like in data: rolls and tip-overs fall short, turns on the spot as well.
What it is confused with: soft_ground, cap_friction, and the numerics of another engine.
Source: rolling friction (Johnson, Contact Mechanics, ch. 9).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values, WorldTerms
from r2s2r_cli.engine.structure import Structure

TINY = 1e-12
"""[rad^2/s^2] squared angular velocity below which it has no direction."""


class RollingResistance(Effect):
    """A dry torque against rolling and turning of rods that touch the ground."""

    name = "rolling_resistance"
    channel = Channel.CONTACT
    title = "rolling and torsional resistance"
    own = (
        EffectParameter("rolling_m", "m", 0.0, 0.005, off=0.0, scale=0.0015, what="arm of the torque against rolling"),
        EffectParameter("torsion_m", "m", 0.0, 0.005, off=0.0, scale=0.0015, what="arm of the torque against turning"),
    )
    look_alikes = ("soft_ground", "cap_friction", "friction_field")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "rolls, tip-overs and turns on the spot fall short"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Normal force on each cap in the last step [N]."""
        return {"force": 2 * structure.n_rods}

    def landed(self, x: Values, z: Values, force: Tensor, h: Tensor) -> Values:
        """Remembered for the next step."""
        del x, z, h
        return {"force": force.flatten(1)}

    def resist(self, x: Values, z: Values, terms: WorldTerms, torque: Tensor, h: Tensor) -> Tensor:
        """The torque of both caps of a rod."""
        load = z["force"].unflatten(-1, (-1, 2)).sum(-1)
        up = terms.R_GR[..., 2, :]  # the vertical in rod axes, (B, rod, 3)
        turning = (up * terms.turning).sum(-1, keepdim=True) * up
        rolling = terms.turning - turning
        found = torque
        for spin, arm in ((rolling, x["rolling_m"]), (turning, x["torsion_m"])):
            squared = (spin * spin).sum(-1)
            some = squared > TINY
            safe = torch.where(some, squared, torch.ones_like(squared))
            per_speed = arm * load / torch.sqrt(safe)
            mobility = (spin * (terms.inverse_inertia * spin[..., None, :]).sum(-1)).sum(-1) / safe
            stopping = 1.0 / (h * torch.where(some, mobility, torch.ones_like(mobility)))
            brake = torch.where(some, torch.minimum(per_speed, stopping), torch.zeros_like(per_speed))
            found = found - brake[..., None] * spin
        return found

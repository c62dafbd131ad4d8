"""Viscous drag of the contact.

What it is: a sticky or wet floor brakes what slides on it the more the faster it is.
Where it acts: channel contact; `drag_s_per_m` times the speed of a cap along the ground is added to its friction
coefficient. So the drag goes with the load and ends with the contact, the contact solve never lets it turn a slip
round, and a cap that friction holds has none of it and cannot creep. A force of its own would have none of this.
Parameters: drag_s_per_m, growth of the coefficient with speed.
What it looks like in data: fast slips are shortened, slow ones are as they were.
What it is confused with: air_drag (brakes what touches nothing, too), stribeck.
Source: viscous term of the friction coefficient (Coulomb plus viscous, Olsson et al., Eur. J. Control 1998).
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, ContactTerms, Values

SLOW = 1e-3
"""[m/s] speed below which the drag fades quadratically: its derivative is 0 at rest, not a corner."""


class ViscousContact(Effect):
    """Friction coefficient that grows with the speed of slip."""

    name = "viscous_contact"
    channel = Channel.CONTACT
    title = "viscous drag of the contact"
    own = (
        EffectParameter("drag_s_per_m", "s/m", 0.0, 10.0, off=0.0, scale=2.0, what="friction coefficient per speed"),
    )
    look_alikes = ("air_drag", "stribeck")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "fast slips are shortened, slow ones as they were"

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Friction of every cap and what its speed adds, which is 0 at rest."""
        vx, vy = terms.v_GC[..., 0], terms.v_GC[..., 1]
        squared = vx * vx + vy * vy
        return friction + x["drag_s_per_m"][..., None] * squared / torch.sqrt(squared + SLOW * SLOW)

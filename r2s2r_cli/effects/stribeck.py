"""Static and kinetic friction.

What it is: a cap at rest grips more than one that slides.
Where it acts: channel contact; factor 1 + (static_factor - 1) exp(-(v / speed)^2) on the friction of a cap, by the
speed v of its lowest point along the ground at the start of the step. The coefficient without the effect is the kinetic
one.
Parameters: static_factor, coefficient at rest over that of a fast slip; speed_m_per_s, where 1/e of the excess is left.
What it looks like in data: caps hold on for longer, then jump; long slips are as they were.
What it is confused with: friction_field (follows the place), viscous_contact and air_drag (which brake what is fast).
Source: Stribeck curve with Gaussian decay (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 1994).
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, ContactTerms, Values


class Stribeck(Effect):
    """Friction coefficient that falls with the speed of slip."""

    name = "stribeck"
    channel = Channel.CONTACT
    title = "static and kinetic friction"
    own = (
        EffectParameter("static_factor", "1", 1.0, 1.6, off=1.0, scale=0.2,
                        what="friction at rest over that of a slip"),
        EffectParameter("speed_m_per_s", "m/s", 0.002, 0.2, off=0.02, scale=0.02, only_shape=True,
                        what="of slip, where 1/e of the excess is left"),
    )  # fmt: skip
    look_alikes = ("friction_field", "viscous_contact", "air_drag")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "caps hold on for longer, then jump"

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Friction of every cap by the square of its speed, which has a derivative at rest as well."""
        excess, speed = x["static_factor"][..., None] - 1.0, x["speed_m_per_s"][..., None]
        vx, vy = terms.v_GC[..., 0], terms.v_GC[..., 1]
        return friction * (1.0 + excess * torch.exp(-(vx * vx + vy * vy) / (speed * speed)))

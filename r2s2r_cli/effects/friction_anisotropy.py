"""Friction that depends on the direction of slip.

What it is: a floor with a grain (brushed carpet, planks, corrugated rubber) grips more across it than along it.
Where it acts: channel contact; factor on the friction of a cap by the direction in which it slips in the world's frame:
an ellipse with semi-axes sqrt(ratio) along `angle_rad` and 1 / sqrt(ratio) across it, so that the geometric mean stays
what it is. Friction stays opposite to slip. A cap at rest holds with the plain coefficient, that mean: its velocity
does not tell which way it is pushed; with the weakest grip all caps would let go early, with the strongest every start
would be a jump.
Parameters: ratio, grip along the axis over grip across it; angle_rad of the axis, from the world's x.
What it looks like in data: slips go far along one line of the room and not across it, whichever way the robot faces.
What it is confused with: ground_slope (pulls one way, where grain has no sign), friction_field (follows the place).
Source: friction ellipse of anisotropic surfaces (Zmitrowicz 1989), here of the coefficient against the slip direction.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, ContactTerms, Values

CREEP = 2e-3
"""[m/s] slip that counts half. Where the grain holds more than the mean, caps that are pushed between both creep about
so fast: slower than slips are, and fast enough that friction that grows with speed is stable in explicit steps."""


class FrictionAnisotropy(Effect):
    """Friction coefficient by the direction of slip: an ellipse."""

    name = "friction_anisotropy"
    channel = Channel.CONTACT
    title = "friction that depends on the direction of slip"
    own = (
        EffectParameter("ratio", "1", 0.5, 2.0, off=1.0, scale=0.3, start=1.15,
                        what="grip along the axis over grip across it"),
        EffectParameter("angle_rad", "rad", -1.6, 1.6, off=0.0, scale=math.pi / 4, only_shape=True,
                        what="of the axis, from the world's x towards its y"),
    )  # fmt: skip
    look_alikes = ("ground_slope", "friction_field")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "slips go far along one line of the room and not across it, whichever way the robot faces"

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Radius of the ellipse in the direction of every cap's slip; 1 at rest."""
        ratio, angle = x["ratio"][..., None], x["angle_rad"][..., None]
        vx, vy = terms.v_GC[..., 0], terms.v_GC[..., 1]
        along, across = torch.cos(angle) * vx + torch.sin(angle) * vy, torch.cos(angle) * vy - torch.sin(angle) * vx
        weight = 1.0 / (vx * vx + vy * vy + CREEP * CREEP)
        bent = ((1.0 / ratio - 1.0) * along * along + (ratio - 1.0) * across * across) * weight
        return friction / torch.sqrt(1.0 + bent)

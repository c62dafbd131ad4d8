"""Friction that depends on the place.

What it is: the floor is more slippery in some places: a gradient across it, or a patch.
Where it acts: channel contact; factor (1 + g . p) (1 + (f - 1) w) on the friction of a cap above p; the weight w of the
patch is 1 / (1 + (d / r)^4), d the distance from its centre: flat inside, 1/2 at the radius, soon 0 outside.
Parameters: gradient_x_per_m, gradient_y_per_m (the origin of the world has the nominal friction); patch_factor,
patch_x_m, patch_y_m, patch_radius_m.
What it looks like in data: slip residuals tied to a place on the floor, whichever cap and phase of the gait is there.
What it is confused with: cap_friction (follows the cap), battery_sag in one long run (where time is place).
Source: the unexplained turning of the paper's second iteration.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, ContactTerms, Values


class FrictionField(Effect):
    """Friction with a gradient over the floor and a patch."""

    name = "friction_field"
    channel = Channel.CONTACT
    title = "friction that depends on the place"
    own = (
        EffectParameter("gradient_x_per_m", "1/m", -2.0, 2.0, off=0.0, scale=0.5, what="relative, along the world's x"),
        EffectParameter("gradient_y_per_m", "1/m", -2.0, 2.0, off=0.0, scale=0.5, what="relative, along the world's y"),
        EffectParameter(
            "patch_factor", "1", 0.1, 2.0, off=1.0, scale=0.4, start=0.8, what="of the friction on the patch"
        ),
        EffectParameter("patch_x_m", "m", -2.0, 2.0, off=0.0, scale=0.3, only_shape=True, what="centre of the patch"),
        EffectParameter("patch_y_m", "m", -2.0, 2.0, off=0.0, scale=0.3, only_shape=True, what="centre of the patch"),
        EffectParameter(
            "patch_radius_m", "m", 0.03, 1.0, off=0.15, scale=0.1, only_shape=True, what="where half of it is left"
        ),
    )
    look_alikes = ("cap_friction", "battery_sag")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "slip residuals are tied to a place on the floor, not to a cap or a phase of the gait"

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Friction of every cap at its place; never negative."""
        v = {name: value[..., None] for name, value in x.items()}
        px, py = terms.p_GC[..., 0], terms.p_GC[..., 1]
        slope = torch.relu(1.0 + v["gradient_x_per_m"] * px + v["gradient_y_per_m"] * py)
        dx, dy, r = px - v["patch_x_m"], py - v["patch_y_m"], v["patch_radius_m"]
        near = (dx * dx + dy * dy) / (r * r)
        return friction * slope * (1.0 + (v["patch_factor"] - 1.0) / (1.0 + near * near))

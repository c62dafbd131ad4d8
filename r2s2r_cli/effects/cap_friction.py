"""A worn or dirty cap.

What it is: single caps grip the ground more or less than the others.
Where it acts: channel contact; factor on the friction coefficient of each cap.
Parameters: factor, one a cap.
What it looks like in data: slip residuals that follow the cap, wherever it touches.
What it is confused with: friction_field (follows the place instead of the cap).
Source: Coulomb friction per contact.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, ContactTerms, Values


class CapFriction(Effect):
    """Friction coefficient of each cap times a factor."""

    name = "cap_friction"
    channel = Channel.CONTACT
    title = "worn or dirty cap"
    own = (EffectParameter("factor", "1", 0.05, 3.0, off=1.0, scale=0.3, what="of the cap's friction", per="cap"),)
    look_alikes = ("friction_field",)

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "slip residuals follow one cap, not a place"

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Friction of every cap, (B, rod, 2)."""
        del terms
        return friction * x["factor"].unflatten(-1, (-1, 2))

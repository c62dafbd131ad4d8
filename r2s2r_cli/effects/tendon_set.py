"""Plastic set of the cables.

What it is: a cable has become longer, or slipped in its knots: its rest length is not the one of the model.
Where it acts: channel cable; an offset on the rest length of each cable, on top of what its winch gives.
Parameters: shift_m, + is longer, one a cable.
What it looks like in data: a constant bias of the shape in every key frame, in robot axes.
What it is confused with: tendon_stiffness (whose bias grows with the tension), sensor_bias (in closed loop).
Source: permanent elongation of braided cable.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class TendonSet(Effect):
    """Rest length of each cable plus an offset."""

    name = "tendon_set"
    channel = Channel.CABLE
    title = "plastic set of a cable"
    own = (EffectParameter("shift_m", "m", -0.04, 0.04, off=0.0, scale=0.005, what="of the rest length", per="cable"),)
    look_alikes = ("tendon_stiffness", "sensor_bias")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "the shape has the same bias in every key frame, in robot axes"

    def rest(self, x: Values, rest: Tensor) -> Tensor:
        """The offset added."""
        return rest + x["shift_m"]

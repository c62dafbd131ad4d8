"""Build-up of cable on the spool.

What it is: wound cable makes the spool thicker, so that a winch is faster the more it has wound.
Where it acts: channel motor; winding rate times 1 + c * wound, wound being the length beyond the cable at its longest.
Parameters: per_metre, c, for all winches.
What it looks like in data: curved length ramps: steeper towards the short end.
What it is confused with: motor_speed_mismatch (a refit of the speed absorbs most of it).
Source: radius of a layered spool to first order.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, MotorTerms, Values


class SpoolBuildup(Effect):
    """Winches wind faster the more is on their spools."""

    name = "spool_buildup"
    channel = Channel.MOTOR
    title = "build-up of cable on the spool"
    own = (
        EffectParameter("per_metre", "1/m", 0.0, 6.0, off=0.0, scale=1.0, what="gain of radius per wound length"),
    )  # fmt: skip
    look_alikes = ("motor_speed_mismatch",)

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "length ramps are curved: steeper towards the short end"

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Faster by what is wound."""
        del h
        return rate * (1.0 + x["per_metre"] * terms.wound), z

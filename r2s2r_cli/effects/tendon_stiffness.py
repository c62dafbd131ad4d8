"""Softened or stiffened cables.

What it is: a cable is softer or stiffer than the model says, by wear, its knots or its material.
Where it acts: channel cable; factor on every coefficient of the force law of each cable.
Parameters: factor, one a cable.
What it looks like in data: the shape is biased along that cable in every key frame in which it is tense.
What it is confused with: sensor_gain, tendon_set (whose bias does not grow with the tension).
Source: scatter of tendon force-displacement curves (paper, section System Identification).
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters


class TendonStiffness(Effect):
    """Force law of each cable times a factor."""

    name = "tendon_stiffness"
    channel = Channel.CABLE
    title = "softened or stiffened cable"
    own = (EffectParameter("factor", "1", 0.5, 1.5, off=1.0, scale=0.2, what="of the force law", per="cable"),)
    look_alikes = ("sensor_gain", "tendon_set")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "the shape is biased along one cable wherever that is tense"

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """All coefficients."""
        f = x["factor"]
        return replace(
            theta, stiffness=theta.stiffness * f, stiffness2=theta.stiffness2 * f, stiffness3=theta.stiffness3 * f
        )

"""Motors of unequal speed.

What it is: one winch is faster or slower than the model says, by its motor, gearbox or spool.
Where it acts: channel motor; factor on the winding rates of each winch.
Parameters: factor, one a winch.
What it looks like in data: the slope of one cable's length ramps, in every run and at every load.
What it is confused with: load_droop, spool_buildup, battery_sag (which change the slope with tension, length and time).
Source: scatter of no-load speeds.
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters


class MotorSpeedMismatch(Effect):
    """Winding rates of each winch times a factor."""

    name = "motor_speed_mismatch"
    channel = Channel.MOTOR
    title = "motors of unequal speed"
    own = (EffectParameter("factor", "1", 0.6, 1.4, off=1.0, scale=0.15, what="of the winding rate", per="actuated"),)
    look_alikes = ("load_droop", "spool_buildup", "battery_sag")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "the length ramps of one cable are always steeper or flatter"

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Both directions."""
        return replace(theta, speed_in=theta.speed_in * x["factor"], speed_out=theta.speed_out * x["factor"])

"""Load droop of the motors.

What it is: a loaded winch is slower than an idle one, and never as much slower when it pays out.
Where it acts: channel motor; winding rate inwards times 1 - b T, T the tension of its cable, never below 0.
Parameters: per_newton, b, for all winches.
What it looks like in data: ramps are flat while the cable is tense and steep while it is slack.
What it is confused with: backlash, battery_sag, camera_delay.
Source: linear torque-speed line of a DC motor.
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


class LoadDroop(Effect):
    """Winches slow down under tension."""

    name = "load_droop"
    channel = Channel.MOTOR
    title = "load droop of the motors"
    own = (
        EffectParameter("per_newton", "1/N", 0.0, 0.05, off=0.0, scale=0.008, what="loss of speed per tension"),
    )  # fmt: skip
    look_alikes = ("backlash", "battery_sag", "camera_delay")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "length ramps are flat while the cable is tense and steep while it is slack"

    def structure(self, structure: Structure) -> Structure:
        """The winches droop."""
        return replace(structure, droop=True)

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Added to the droop that the winches have."""
        return replace(theta, droop=theta.droop + x["per_newton"])

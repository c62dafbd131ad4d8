"""First-order motor lag.

What it is: a winch reaches its commanded speed exponentially, and runs on as slowly.
Where it acts: channel motor; tau w' = u - w, implicit in the step.
Parameters: tau_s, the time constant.
What it looks like in data: ramps of cable length with rounded starts, and a run-on after every stop.
What it is confused with: command_latency (a pure shift without rounding).
Source: first-order DC motor with neglected inductance.
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


class MotorLag(Effect):
    """First-order lag of every winch."""

    name = "motor_lag"
    channel = Channel.MOTOR
    title = "first-order motor lag"
    own = (EffectParameter("tau_s", "s", 0.0, 0.5, off=0.0, scale=0.05, what="time constant of every winch"),)
    look_alikes = ("command_latency", "camera_delay")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "length ramps start rounded and run on after the stop"

    def structure(self, structure: Structure) -> Structure:
        """The winches follow with a lag."""
        return replace(structure, lag=True)

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Added to the time constant that the winches have."""
        return replace(theta, lag=theta.lag + x["tau_s"])

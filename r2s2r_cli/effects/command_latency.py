"""Command latency.

What it is: radio, firmware and motor driver hold every command back by the same time.
Where it acts: channel command; the winches receive u(t - tau). It is a shift of the commands before the step, not a
state of it: exact, and differentiable.
Parameters: tau_s, the delay.
What it looks like in data: every step of the gait starts and ends late by the same time; in closed loop ends overshoot.
What it is confused with: motor_lag (rounds as well), camera_delay (with end caps alone the very same).
Source: dead time of a control loop.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class CommandLatency(Effect):
    """Commands arrive late."""

    name = "command_latency"
    channel = Channel.COMMAND
    title = "command latency"
    own = (EffectParameter("tau_s", "s", 0.0, 0.3, off=0.0, scale=0.08, what="time from a command to the winches"),)
    look_alikes = ("motor_lag", "camera_delay", "backlash")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "every ramp of cable length starts and ends late by the same time"

    def delay(self, x: Values) -> Tensor:
        """The delay."""
        return x["tau_s"]

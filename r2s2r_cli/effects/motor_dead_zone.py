"""Motor dead zone.

What it is: a winch does not turn at commands that are too small to overcome the stiction of motor and gearbox.
Where it acts: channel command; commands below a threshold become 0. Over the last 0.02 of it the winch comes loose only
in part of its turns, so that the law has a derivative.
Parameters: threshold, as a share of full command, one a winch; above 1 it never turns.
What it looks like in data: cables stall shortly before their target, or never start. Invisible where a command that
saturates turns the winch.
What it is confused with: sensor_bias, sensor_gain (a cable that stops off its target).
Source: Coulomb stiction of DC gear motors.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values

EDGE = 0.02
"""Share of full command over which the stiction of a turning shaft varies."""


class MotorDeadZone(Effect):
    """No motion below a threshold of the command."""

    name = "motor_dead_zone"
    channel = Channel.COMMAND
    title = "motor dead zone"
    own = (
        EffectParameter("threshold", "1", 0.0, 1.2, off=0.0, scale=0.15,
                        what="command below which the winch stands still", per="actuated", tried=(0.5, 1.1)),
    )  # fmt: skip
    look_alikes = ("sensor_bias", "sensor_gain")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "cables stall shortly before their target, and nothing changes while commands saturate"

    def command(self, x: Values, z: Values, u: Tensor, h: Tensor) -> tuple[Tensor, Values]:
        """The command, 0 below the threshold less the edge."""
        del h
        return u * torch.clamp(1.0 - (x["threshold"] - torch.abs(u)) / EDGE, 0.0, 1.0), z

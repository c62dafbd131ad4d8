"""Saturation of the cable sensors.

What it is: a cable sensor that is stretched too far shows no more, and one that hangs slack shows no less.
Where it acts: channel sensing; of what a length is beyond the top of a sensor's range, or below its bottom, a share is
not shown: with all of it the reading is clipped. The controller acts on the reading, and it is recorded.
Parameters: top_share and bottom_share, one each a sensor; top_m and bottom_m, the ends of the range of all of them.
What it looks like in data: recorded lengths have flat tops or bottoms that the end caps do not have; cables that are to
go there are never done, or at once.
What it is confused with: sensor_gain (from the middle on, not from an end), motor_dead_zone, sensor_bias.
Source: stretch sensors, which hang slack when they are short, and circuits, which have a largest reading.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class SensorSaturation(Effect):
    """Each sensor's reading, flatter beyond the ends of its range."""

    name = "sensor_saturation"
    channel = Channel.SENSING
    title = "saturation of the cable sensors"
    own = (
        EffectParameter("top_share", "1", 0.0, 1.0, off=0.0, scale=0.5, what="not shown, of what is above",
                        per="sensor"),
        EffectParameter("bottom_share", "1", 0.0, 1.0, off=0.0, scale=0.5, what="not shown, of what is below",
                        per="sensor"),
        EffectParameter("top_m", "m", 0.1, 0.5, off=0.17, scale=0.02, only_shape=True,
                        what="length at the top of the range"),
        EffectParameter("bottom_m", "m", 0.02, 0.3, off=0.13, scale=0.02, only_shape=True,
                        what="length at the bottom of the range"),
    )  # fmt: skip
    look_alikes = ("sensor_gain", "sensor_bias", "motor_dead_zone")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "recorded lengths have flat tops or bottoms that the end caps do not have"

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """What the sensors read."""
        del t
        beyond, below = torch.relu(length - x["top_m"]), torch.relu(x["bottom_m"] - length)
        return length - x["top_share"] * beyond + x["bottom_share"] * below

"""Gain of the cable sensors.

What it is: the calibrated slope of a cable sensor is wrong.
Where it acts: channel sensing; factor on how far from ABOUT_M each sensor reads: the controller acts on it, and it is
recorded. A line through calibration points turns about their middle, not about a length of 0.
Parameters: gain, one a sensor.
What it looks like in data: recorded lengths disagree with the end caps the more the further from the middle of the
travel; in closed loop the gait is too large or too small.
What it is confused with: tendon_stiffness, camera_scale (with few cables).
Source: slopes of capacitive sensors (paper, section Calibration).
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values

ABOUT_M = 0.15
"""[m] Length that is shown right: the middle of the travel of the 3-bar robot's cables. On a robot of other lengths the
sensor's offset, which every fit has, makes up for the difference."""


class SensorGain(Effect):
    """Each sensor's reading, from a middle length on, times a factor."""

    name = "sensor_gain"
    channel = Channel.SENSING
    title = "gain of the cable sensors"
    own = (EffectParameter("gain", "1", 0.8, 1.25, off=1.0, scale=0.03, what="of the reading", per="sensor"),)
    look_alikes = ("tendon_stiffness", "camera_scale", "motor_dead_zone")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "recorded changes of length disagree with those of the end caps in proportion"

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """What the sensors read."""
        del t
        return length + (x["gain"] - 1.0) * (length - ABOUT_M)

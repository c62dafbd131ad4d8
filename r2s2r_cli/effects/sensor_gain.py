"""Gain of the cable sensors.

What it is: the calibrated slope of a cable sensor is wrong.
Where it acts: channel sensing; factor on what each sensor reads: the controller acts on it, and it is recorded.
Parameters: gain, one a sensor.
What it looks like in data: recorded lengths disagree with the end caps in proportion to the length; in closed loop the
gait is too large or too small.
What it is confused with: tendon_stiffness, camera_scale (with few cables).
Source: slopes of capacitive sensors (paper, section Calibration); diagnosis.md catalogue S2.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class SensorGain(Effect):
    """Each sensor's reading times a factor."""

    name = "sensor_gain"
    channel = Channel.SENSING
    title = "gain of the cable sensors"
    own = (EffectParameter("gain", "1", 0.8, 1.25, off=1.0, scale=0.03, what="of the reading", per="sensor"),)
    look_alikes = ("tendon_stiffness", "camera_scale", "motor_dead_zone")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "recorded lengths disagree with the end caps in proportion to the length"

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """What the sensors read."""
        del t
        return length * x["gain"]

"""Bias and drift of the cable sensors.

What it is: a cable sensor reads too much by a constant, or by more and more.
Where it acts: channel sensing; added to what each sensor reads: the controller acts on it, and it is recorded.
Parameters: bias_m, and drift_m_per_s from the start of the run, one each a sensor.
What it looks like in data: in closed loop cables stop off their target by a constant; recorded lengths disagree with
the end caps by as much.
What it is confused with: tendon_set, motor_dead_zone.
Source: drift of capacitive sensors (paper, section Calibration).
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class SensorBias(Effect):
    """Each sensor's reading plus a constant and a drift."""

    name = "sensor_bias"
    channel = Channel.SENSING
    title = "bias and drift of the cable sensors"
    own = (
        EffectParameter("bias_m", "m", -0.02, 0.02, off=0.0, scale=0.005, what="of the reading", per="sensor"),
        EffectParameter("drift_m_per_s", "m/s", -5e-4, 5e-4, off=0.0, scale=1e-4, what="of the reading", per="sensor"),
    )
    look_alikes = ("tendon_set", "motor_dead_zone")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "recorded lengths disagree with the end caps by a constant, and cables stop off their target"

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """What the sensors read."""
        return length + x["bias_m"] + x["drift_m_per_s"] * t

"""Camera scale.

What it is: the camera's depth scale or focal length is off: everything is seen larger or smaller.
Where it acts: channel observation; factor on the observed end caps, about the origin of the world.
Parameters: factor.
What it looks like in data: rods of the wrong length, from one cap to the other.
What it is confused with: nothing that rod lengths do not tell apart; sensor_gain of all sensors alike.
Source: intrinsic calibration.
"""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class CameraScale(Effect):
    """End caps seen at a scale."""

    name = "camera_scale"
    channel = Channel.OBSERVATION
    title = "camera scale"
    own = (EffectParameter("factor", "1", 0.95, 1.05, off=1.0, scale=0.015, what="of everything seen"),)
    look_alikes = ("sensor_gain",)

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "rods have the wrong length"

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """Scaled."""
        del t
        return p_WE * x["factor"][..., None, None]

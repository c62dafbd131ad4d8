"""Worn caps.

What it is: single caps have lost rubber, or are wrapped in tape.
Where it acts: channel contact; an offset on the radius of each cap.
Parameters: change_m, one a cap.
What it looks like in data: caps that touch the ground sit lower, and rolls go less far a turn.
What it is confused with: soft_ground, camera_pose (a camera that sees everything lower).
Source: geometry.
"""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters


class CapRadius(Effect):
    """Radius of each cap plus an offset."""

    name = "cap_radius"
    channel = Channel.CONTACT
    title = "worn caps"
    own = (EffectParameter("change_m", "m", -0.006, 0.006, off=0.0, scale=0.001, what="of the radius", per="cap"),)
    look_alikes = ("soft_ground", "camera_pose")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "caps sit lower or higher on the ground, and rolls go less or more far"

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """The offset added."""
        return replace(theta, cap_radius=theta.cap_radius + x["change_m"].unflatten(-1, (-1, 2)))

"""Ground slope.

What it is: the ground is not level. The estimate makes the ground the plane z = 0, so a slope shows as gravity that
leans against it.
Where it acts: channel world; gravity in the ground's frame.
Parameters: angle_x_rad, angle_y_rad, the ground's rotation about the x, then the y axis of the world.
What it looks like in data: a drift downhill, in one direction of the world, whatever the gait.
What it is confused with: camera_pose (a tilted camera leans the observations, not the motion), tether_drag.
Source: statics.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters

_STEEPEST = 0.0873
"""5 degrees."""


class GroundSlope(Effect):
    """Gravity turned against the ground's normal."""

    name = "ground_slope"
    channel = Channel.WORLD
    title = "ground slope"
    own = (
        EffectParameter("angle_x_rad", "rad", -_STEEPEST, _STEEPEST, off=0.0, scale=0.02,
                        what="rotation of the ground about the world's x axis"),
        EffectParameter("angle_y_rad", "rad", -_STEEPEST, _STEEPEST, off=0.0, scale=0.02,
                        what="rotation of the ground about the world's y axis"),
    )  # fmt: skip
    look_alikes = ("camera_pose", "tether_drag")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "drift downhill in one direction of the world, whatever the gait"

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Gravity as the ground's frame sees it: turned back by the ground's rotation R_y R_x."""
        gx, gy, gz = theta.gravity.unbind(-1)
        a, b = x["angle_x_rad"][:, 0], x["angle_y_rad"][:, 0]
        gx, gz = torch.cos(b) * gx - torch.sin(b) * gz, torch.sin(b) * gx + torch.cos(b) * gz
        gy, gz = torch.cos(a) * gy + torch.sin(a) * gz, torch.cos(a) * gz - torch.sin(a) * gy
        return replace(theta, gravity=torch.stack([gx, gy, gz], dim=-1))

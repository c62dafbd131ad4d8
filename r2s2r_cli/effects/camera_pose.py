"""Camera pose.

What it is: the camera is not where its calibration says, or the ground plane was fitted badly.
Where it acts: channel observation; the end caps are seen turned about the axes of the world (x, then y, then z) and
shifted. The robot itself moves as without it.
Parameters: turn_x_rad, turn_y_rad (tilt), turn_z_rad (yaw); shift_x_m, shift_y_m, shift_z_m.
What it looks like in data: all frames differ by one rigid motion; cap heights lean to one side.
What it is confused with: ground_slope (which moves the robot), cap_radius.
Source: extrinsic calibration.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values

_TURN, _SHIFT = 0.1745, 0.05


class CameraPose(Effect):
    """End caps seen turned and shifted."""

    name = "camera_pose"
    channel = Channel.OBSERVATION
    title = "camera pose"
    own = (
        EffectParameter("turn_x_rad", "rad", -_TURN, _TURN, off=0.0, scale=0.02, what="about the world's x axis"),
        EffectParameter("turn_y_rad", "rad", -_TURN, _TURN, off=0.0, scale=0.02, what="about the world's y axis"),
        EffectParameter("turn_z_rad", "rad", -_TURN, _TURN, off=0.0, scale=0.03, what="about the world's z axis"),
        EffectParameter("shift_x_m", "m", -_SHIFT, _SHIFT, off=0.0, scale=0.01, what="along the world's x axis"),
        EffectParameter("shift_y_m", "m", -_SHIFT, _SHIFT, off=0.0, scale=0.01, what="along the world's y axis"),
        EffectParameter("shift_z_m", "m", -_SHIFT, _SHIFT, off=0.0, scale=0.005, what="along the world's z axis"),
    )
    look_alikes = ("ground_slope", "cap_radius")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "all frames differ by one rigid motion; the robot moves as without it"

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """R_z R_y R_x p + shift."""
        del t
        v = {name: value[..., None] for name, value in x.items()}
        px, py, pz = p_WE.unbind(-1)
        a, b, c = v["turn_x_rad"], v["turn_y_rad"], v["turn_z_rad"]
        py, pz = torch.cos(a) * py - torch.sin(a) * pz, torch.sin(a) * py + torch.cos(a) * pz
        px, pz = torch.cos(b) * px + torch.sin(b) * pz, torch.cos(b) * pz - torch.sin(b) * px
        px, py = torch.cos(c) * px - torch.sin(c) * py, torch.sin(c) * px + torch.cos(c) * py
        return torch.stack([px + v["shift_x_m"], py + v["shift_y_m"], pz + v["shift_z_m"]], dim=-1)

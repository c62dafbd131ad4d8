"""Cables that are tied elsewhere.

What it is: the points where cables are tied to a cap are not where `robot.toml` has them.
Where it acts: channel cable; all attachment points nearest to one cap move with it, in the axes of its rod. Lengths of
cables are between these points, so that their tension changes as well as its arm.
Parameters: x_m, y_m, across the rod, and axial_m, + towards the odd cap, one each a cap.
What it looks like in data: a bias of the shape and a torque on one rod that depend on the pose, not on time.
What it is confused with: com_offset (which leaves the tensions alone), tendon_set (which is of one cable).
Source: geometry.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values
from r2s2r_cli.engine.parameters import Parameters


class AttachmentOffset(Effect):
    """The attachment points of each cap moved."""

    name = "attachment_offset"
    channel = Channel.CABLE
    title = "cables that are tied elsewhere"
    own = (
        EffectParameter("x_m", "m", -0.008, 0.008, off=0.0, scale=0.003, what="across the rod, its x axis", per="cap"),
        EffectParameter("y_m", "m", -0.008, 0.008, off=0.0, scale=0.003, what="across the rod, its y axis", per="cap"),
        EffectParameter("axial_m", "m", -0.008, 0.008, off=0.0, scale=0.003, what="along the rod's axis", per="cap"),
    )
    look_alikes = ("com_offset", "tendon_set")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "a bias of the shape and a torque on one rod that depend on the pose"

    def tied(self, x: Values, theta: Parameters, rods: Tensor) -> Tensor:
        """All points of a cap moved by its offset."""
        p_BE = theta.p_BE[:, rods]  # of the rod of each end, (B, cable, 2, 2, 3)
        odd = 2.0 * theta.p_BS[..., 2] > p_BE[..., 2].sum(-1)  # beyond the middle between its caps
        xyz = torch.broadcast_tensors(x["x_m"], x["y_m"], x["axial_m"])
        offset = torch.stack(xyz, dim=-1).unflatten(1, (-1, 2))[:, rods]
        return theta.p_BS + torch.where(odd[..., None], offset[..., 1, :], offset[..., 0, :])

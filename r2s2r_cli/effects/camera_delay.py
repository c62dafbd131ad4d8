"""Camera delay.

What it is: frames carry a time stamp that is later than what they show (+), or earlier.
Where it acts: channel observation; a frame at t shows the robot at t - tau, between simulated frames in proportion;
before the first one and after the last one nothing moves.
Parameters: tau_s, the delay.
What it looks like in data: end caps lag behind the sensors and commands by a constant.
What it is confused with: command_latency (without recorded lengths the very same), backlash, load_droop.
Source: clock synchronisation.
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, Values


class CameraDelay(Effect):
    """End caps seen late."""

    name = "camera_delay"
    channel = Channel.OBSERVATION
    title = "camera delay"
    own = (
        EffectParameter("tau_s", "s", -0.3, 0.3, off=0.0, scale=0.05, what="by which a frame is older than it says"),
    )
    look_alikes = ("command_latency", "backlash", "load_droop")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "end caps lag behind the sensors by a constant time"

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """Interpolated at t - tau."""
        batch, frames = max(len(p_WE), len(x["tau_s"])), p_WE.shape[1]
        if frames < 2:
            return p_WE
        at = torch.minimum(torch.maximum(t - x["tau_s"], t[0]), t[-1]).expand(batch, -1)
        low = torch.clamp(torch.searchsorted(t.contiguous(), at.detach().contiguous(), right=True) - 1, 0, frames - 2)
        share = ((at - t[low]) / (t[low + 1] - t[low]))[..., None, None]
        seen = p_WE.expand(batch, -1, -1, -1)
        environment = torch.arange(batch, device=t.device)[:, None]
        before, after = seen[environment, low], seen[environment, low + 1]
        return torch.where(share < 1.0, before + share * (after - before), after)

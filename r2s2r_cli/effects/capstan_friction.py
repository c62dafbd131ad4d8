"""Friction where the winched cables leave their rods.

What it is: the cord of a winch bends over the edge of its eyelet and rubs there: reeling in, less pull gets through
than the winch gives; letting out, more.
Where it acts: channel cable; the force of each winched cable times exp(wrap * s), s the direction in which its length
between the attachment points goes: what gives is taken to lie behind the eyelet, so that this length is what passes
it, and the friction takes energy whether the winch moves the cable or the robot. After a reversal s goes from one sign
to the other within millimetres; a robot that has rested for long has s = 0.
Parameters: wrap, friction coefficient times angle of the bend, one a winch.
What it looks like in data: cables stick before they change their length, the more the tenser they are: too long after
reeling in, too short after letting out.
What it is confused with: load_droop, tendon_hysteresis, backlash.
Source: belt friction (Euler, Eytelwein); Bouc and Wen's transition.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.effects.turned import turned
from r2s2r_cli.engine.hooks import CableTerms, Channel, Values
from r2s2r_cli.engine.structure import Structure

SLIDE_M = 0.002
"""[m] motion over which friction turns round. Shorter, it would be a spring too stiff for engine steps of 1 ms."""


class CapstanFriction(Effect):
    """The tension of each winched cable times a factor that depends on the way it goes."""

    name = "capstan_friction"
    channel = Channel.CABLE
    title = "friction where cables leave their rods"
    own = (
        EffectParameter(
            "wrap", "1", 0.0, 0.4, off=0.0, scale=0.25, what="friction coefficient times angle", per="actuated"
        ),
    )
    look_alikes = ("load_droop", "tendon_hysteresis", "backlash")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "cables stick before their length changes, the more the tenser they are"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Direction s of each cable; it is followed at the off value too."""
        return {"way": structure.n_cables}

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """What gets past the eyelet. A slack cable does not rub, and keeps its direction."""
        slid = torch.where(terms.stretch > 0, terms.rate, torch.zeros_like(terms.rate))
        way = turned(z["way"], h * slid / SLIDE_M)
        return terms.force * torch.exp(_of_cables(x["wrap"], terms.passive) * way), {"way": way}


def _of_cables(wrap: Tensor, passive: Tensor) -> Tensor:
    """The numbers of the winches, (B, actuated), where their cables stand, (B, cable); 0 for passive cables."""
    winched = 1.0 - passive
    place = winched * torch.cumsum(winched, dim=-1)  # 1, 2, ... of the winched cables, as they come
    number = torch.arange(1, wrap.shape[-1] + 1, dtype=wrap.dtype, device=wrap.device)
    return torch.where(place[..., None] == number, wrap[..., None, :], torch.zeros_like(number)).sum(-1)

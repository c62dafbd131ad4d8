"""Payload on a rod.

What it is: something heavy is fixed to a rod that the model does not know.
Where it acts: channel mass; a point mass on the axis of each rod: mass, centre of mass and inertia (parallel axes).
Parameters: mass_kg and place_m (from the nominal centre of mass, + towards the odd cap), one each a rod.
What it looks like in data: a pair of caps is heavier: it slips less, and the robot tips over other edges.
What it is confused with: com_offset, cap_friction and friction (a refit absorbs most of it).
Source: rigid-body mechanics, parallel-axis theorem.
"""

from __future__ import annotations

import torch

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, MassTerms, Values


class Payload(Effect):
    """A point mass on the axis of each rod."""

    name = "payload"
    channel = Channel.MASS
    title = "payload on a rod"
    own = (
        EffectParameter("mass_kg", "kg", 0.0, 0.08, off=0.0, scale=0.03, what="of the payload", per="rod"),
        EffectParameter("place_m", "m", -0.16, 0.16, off=0.0, scale=0.08, only_shape=True,
                        what="along the rod from its centre of mass", per="rod"),
    )  # fmt: skip
    look_alikes = ("com_offset", "cap_friction")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "one rod is heavier: its caps slip less and the robot tips over other edges"

    def mass(self, x: Values, terms: MassTerms) -> MassTerms:
        """Both bodies as one: mass, common centre, and inertia about that by the reduced mass."""
        added = x["mass_kg"]
        zero = torch.zeros_like(x["place_m"])
        arm = torch.stack([zero, zero, x["place_m"]], dim=-1) - terms.centre
        share = added / (terms.mass + added)
        reduced = (terms.mass * share)[..., None, None]
        same = torch.eye(3, dtype=arm.dtype, device=arm.device)
        across = (arm * arm).sum(-1)[..., None, None] * same - arm[..., :, None] * arm[..., None, :]
        return MassTerms(terms.mass + added, terms.inertia + reduced * across, terms.centre + share[..., None] * arm)

"""Viscoelastic relaxation of the tendons.

What it is: a stretched elastic tendon is stiffer at first and relaxes while it is held. Winched cables are cords, which
do not creep.
Where it acts: channel cable; a spring of `share` times the stiffness in series with a dashpot, beside every passive
cable: a standard linear solid. A robot starts relaxed.
Parameters: share, of the stiffness; tau_s, time constant of the branch.
What it looks like in data: the shape drifts during holds; forces depend on how fast a tendon was stretched.
What it is confused with: tendon_stiffness (no drift), battery_sag (drifts while winches turn, not while they hold).
Source: Maxwell branch (standard linear solid, Zener); diagnosis.md catalogue C3.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import CableTerms, Channel, Values
from r2s2r_cli.engine.structure import Structure


class TendonRelaxation(Effect):
    """A Maxwell branch beside every passive cable."""

    name = "tendon_relaxation"
    channel = Channel.CABLE
    title = "viscoelastic relaxation of the tendons"
    own = (
        EffectParameter("share", "1", 0.0, 1.0, off=0.0, scale=0.3, what="of the stiffness, which relaxes"),
        EffectParameter("tau_s", "s", 0.1, 30.0, off=3.0, scale=3.0, what="time constant of the relaxation"),
    )
    look_alikes = ("tendon_stiffness", "battery_sag")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "the shape drifts while the robot holds, after every change of length"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Stretch of each branch's spring [m]; it is followed at the off value too."""
        return {"stretch": structure.n_cables}

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """The spring force with the branch's, implicit in the step; never pushing."""
        growing = torch.where(terms.stretch > 0, terms.rate, torch.zeros_like(terms.rate))
        stretch = (z["stretch"] + h * growing) / (1.0 + h / x["tau_s"])
        branch = x["share"] * terms.passive * terms.stiffness * stretch
        return torch.relu(terms.force + branch), {"stretch": stretch}

"""Viscoelastic relaxation of the tendons.

What it is: a stretched elastic tendon loses tension while it is held. Winched cables are cords, which do not creep.
Where it acts: channel cable; `share` of the stiffness of every passive cable is a spring in series with a dashpot, the
rest a spring beside it: a standard linear solid, as stiff as `robot.toml` says against what is quick. A robot starts
relaxed.
Parameters: share, of the stiffness; tau_s, time constant with which it is lost.
What it looks like in data: the shape drifts during holds; forces depend on how fast a tendon was stretched.
What it is confused with: tendon_stiffness (no drift), battery_sag (drifts while winches turn, not while they hold).
Source: Maxwell branch (standard linear solid, Zener).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import CableTerms, Channel, Values
from r2s2r_cli.engine.structure import Structure


class TendonRelaxation(Effect):
    """A part of every passive cable is a Maxwell branch."""

    name = "tendon_relaxation"
    channel = Channel.CABLE
    title = "viscoelastic relaxation of the tendons"
    own = (
        EffectParameter("share", "1", 0.0, 1.0, off=0.0, scale=0.15, what="of the stiffness, which relaxes"),
        EffectParameter(
            "tau_s", "s", 0.1, 30.0, off=3.0, scale=3.0, only_shape=True, what="time constant of the relaxation"
        ),
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
        """The spring force less what the branch has let go, implicit in the step; never pushing."""
        growing = torch.where(terms.stretch > 0, terms.rate, torch.zeros_like(terms.rate))
        stretch = (z["stretch"] + h * growing) / (1.0 + h / x["tau_s"])
        missing = torch.relu(terms.stretch) - stretch
        branch = x["share"] * terms.passive * terms.stiffness * missing
        return torch.relu(terms.force - branch), {"stretch": stretch}

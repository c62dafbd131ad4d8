"""Inner friction of the tendons.

What it is: the strands of an elastic tendon rub on each other: it pulls harder while it lengthens than while it
shortens. Winched cables are cords, which do not.
Where it acts: channel cable; a friction of at most `force_n` in every passive cable, which builds up again over
`length_m` after every reversal, whatever the speed. A robot starts without: at rest for long.
Parameters: force_n, the largest friction; length_m, over which it builds up.
What it looks like in data: the same lengths of the winched cables give another shape on the way there and on the way
back, and holding changes nothing about it.
What it is confused with: tendon_relaxation (which a hold lets go), backlash (of the winched cables), capstan_friction.
Source: Bouc and Wen's hysteresis, with equal shares in the form that takes energy on every path (Erlicher and Point).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.effects.turned import turned
from r2s2r_cli.engine.hooks import CableTerms, Channel, Values
from r2s2r_cli.engine.structure import Structure


class TendonHysteresis(Effect):
    """A dry friction beside the spring of every passive cable."""

    name = "tendon_hysteresis"
    channel = Channel.CABLE
    title = "inner friction of the tendons"
    own = (
        EffectParameter("force_n", "N", 0.0, 3.0, off=0.0, scale=0.5, what="largest friction of a tendon"),
        EffectParameter("length_m", "m", 0.001, 0.03, off=0.004, scale=0.003, only_shape=True,
                        what="over which the friction builds up"),
    )  # fmt: skip
    look_alikes = ("tendon_relaxation", "backlash", "capstan_friction")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "the shape at the same cable lengths depends on where they came from, and holds do not change it"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Friction of each cable, as a share of the largest; it is followed at the off value too."""
        return {"turn": structure.n_cables}

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """The spring force and the friction against the change of length; never pushing. A slack cable is not strained:
        it keeps its friction for when it is taut again."""
        strained = torch.where(terms.stretch > 0, terms.rate, torch.zeros_like(terms.rate))
        turn = turned(z["turn"], h * strained / x["length_m"])
        return torch.relu(terms.force + terms.passive * x["force_n"] * turn), {"turn": turn}

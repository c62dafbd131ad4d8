"""Soft ground.

What it is: carpet, foam or caps of soft rubber give way under load and come back with time; sideways they creep.
Where it acts: channel contact; below each cap the surface sinks towards compliance * force with a time constant (a
Kelvin-Voigt foundation), and a cap that friction holds moves sideways at creep * force (a dashpot); both implicit in
the contact solve.
Parameters: compliance_m_per_n; tau_s, the time constant; creep_m_per_ns, speed per sideways force.
What it looks like in data: caps sit lower the more they carry, tip-overs come late, and feet that are pulled slide
apart slowly though friction could hold them.
What it is confused with: rolling_resistance, cap_radius, and the numerics of another engine.
Source: Kelvin-Voigt foundation; creep of rubber (Persson, Sliding Friction, ch. 16).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, GroundTerms, Values
from r2s2r_cli.engine.structure import Structure


class SoftGround(Effect):
    """The ground below each cap sinks under load."""

    name = "soft_ground"
    channel = Channel.CONTACT
    title = "soft ground"
    own = (
        EffectParameter("compliance_m_per_n", "m/N", 0.0, 0.004, off=0.0, scale=0.001, what="depth per force"),
        EffectParameter(
            "tau_s", "s", 0.0, 0.2, off=0.02, scale=0.03, only_shape=True, what="time constant of giving way"
        ),
        EffectParameter(
            "creep_m_per_ns",
            "m/(N s)",
            0.0,
            0.1,
            off=0.0,
            scale=0.01,
            what="sideways speed per force that friction holds",
        ),
    )
    look_alikes = ("rolling_resistance", "cap_radius")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "caps sit lower the more they carry, feet that are pulled slide slowly, and tip-overs come late"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Depth of the surface below each cap [m]."""
        return {"sunk": 2 * structure.n_rods}

    def surface(self, x: Values, z: Values, terms: GroundTerms, h: Tensor) -> GroundTerms:
        """The depth d with tau d' = compliance force - d, by the force of this very step."""
        sunk = z["sunk"].unflatten(-1, (-1, 2))
        slow = (x["tau_s"] + h)[..., None]
        give = x["compliance_m_per_n"][..., None] / (h[..., None] * slow)
        creep = x["creep_m_per_ns"][..., None] / h[..., None]
        return replace(
            terms, sunk=terms.sunk + sunk, rising=terms.rising + sunk / slow, give=terms.give + give,
            creep=terms.creep + creep,
        )  # fmt: skip

    def landed(self, x: Values, z: Values, force: Tensor, h: Tensor) -> Values:
        """The depth after the step."""
        sunk = z["sunk"]
        return {"sunk": sunk + h * (x["compliance_m_per_n"] * force.flatten(1) - sunk) / (x["tau_s"] + h)}

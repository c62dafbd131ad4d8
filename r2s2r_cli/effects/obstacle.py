"""A ridge in the floor.

What it is: a straight ridge across the floor: a strip over a cable, a seam, a threshold.
Where it acts: channel contact; the floor is higher by height exp(-(s/width)^2 / 2) at the distance s from the line
x cos(angle) + y sin(angle) = distance. A cap that moves over it is lifted, and its load in the step before, times the
slope, pushes it downhill. Friction stays that of a level floor, and caps touch below their centres: to first order in
the slope.
Parameters: height_m; ridge_distance_m from the origin of the world and ridge_angle_rad, of the line's normal from the
world's x axis; ridge_width_m, where 61 % of the height is left.
What it looks like in data: caps are held up, or lifted, at one straight line on the floor, whichever cap comes there.
What it is confused with: friction_field (holds both ways, and lifts nothing), ground_slope (the same everywhere).
Source: a smooth frictionless guide: the force of the ground is across it, so that it does no work.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, GroundTerms, Values
from r2s2r_cli.engine.structure import Structure


class Obstacle(Effect):
    """A smooth ridge along a straight line."""

    name = "obstacle"
    channel = Channel.CONTACT
    title = "a ridge in the floor"
    own = (
        EffectParameter("height_m", "m", 0.0, 0.02, off=0.0, scale=0.004, what="of the ridge"),
        EffectParameter("ridge_distance_m", "m", -2.0, 2.0, off=0.0, scale=0.3, only_shape=True,
                        what="of its line from the origin"),
        EffectParameter("ridge_angle_rad", "rad", -3.2, 3.2, off=0.0, scale=0.8, only_shape=True,
                        what="of the line's normal from x"),
        EffectParameter("ridge_width_m", "m", 0.01, 0.1, off=0.03, scale=0.02, only_shape=True,
                        what="from its line to its steepest"),
    )  # fmt: skip
    look_alikes = ("friction_field", "ground_slope")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "caps are held up or lifted at one straight line on the floor, whichever cap comes there"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Normal force on each cap in the last step [N]."""
        return {"force": 2 * structure.n_rods}

    def landed(self, x: Values, z: Values, force: Tensor, h: Tensor) -> Values:
        """Remembered for the next step."""
        del x, z, h
        return {"force": force.flatten(1)}

    def surface(self, x: Values, z: Values, terms: GroundTerms, h: Tensor) -> GroundTerms:
        """The floor below each cap, and how fast it comes up as the cap moves over it."""
        del z, h
        height, slope = _ridge(x, terms.p_GC)
        rising = (slope * terms.v_GC).sum(-1)
        # On a slope so steep that the push of one load makes the next one swing from step to step, the floor gives way
        # by what that push takes off its rise.
        sideways = terms.mobility[..., 0] + terms.mobility[..., 1]
        give = torch.relu(2.0 * (slope * slope).sum(-1) * sideways - terms.mobility[..., 2])
        return replace(terms, sunk=terms.sunk - height, rising=terms.rising + rising, give=terms.give + give)

    def push(self, x: Values, z: Values, p_GC: Tensor, force: Tensor) -> Tensor:
        """Downhill, load times slope."""
        return force - z["force"].unflatten(-1, (-1, 2))[..., None] * _ridge(x, p_GC)[1]


def _ridge(x: Values, p_GC: Tensor) -> tuple[Tensor, Tensor]:
    """Height of the floor [m], (B, rod, 2), and its gradient in G, (B, rod, 2, 3), at places of the same shape."""
    angle, width = x["ridge_angle_rad"], x["ridge_width_m"][..., None]
    normal = torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)], dim=-1)[:, None]
    away = ((p_GC * normal).sum(-1) - x["ridge_distance_m"][..., None]) / width
    height = x["height_m"][..., None] * torch.exp(-0.5 * away * away)
    return height, (-height * away / width)[..., None] * normal

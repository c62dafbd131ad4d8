"""Collisions between rods: placeholder while the ground contact is brought up."""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.engine.body import Bodies
from r2s2r_cli.engine.contact import GroundRows, applied
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


def collide(
    structure: Structure, theta: Parameters, rods: Bodies, ground: GroundRows, contact: Tensor, v: Tensor, w: Tensor, h: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    v, w = applied(rods, ground, contact, v, w)
    return v, w, contact

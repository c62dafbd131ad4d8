"""One free rod with an effect: what laws of contact, mass and world are held against closed forms with."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from r2s2r_cli.effects import Effect, with_off_values
from r2s2r_cli.engine import Parameters, Structure
from tests.support.engine import Number, free_rods, parameters

ROUNDING = 1e-6
"""[J] that a step may add to a rod which rolls without slip, by the order of the scheme, with no effect at all; a slip
loses a hundred times that."""


def lone_rod(effect: Effect, values: Mapping[str, float], **numbers: Number) -> tuple[Structure, Parameters]:
    """The rod, with the effect at these values, all elements alike. numbers: of the engine's parameters."""
    structure = free_rods(1, rod_contact=False).with_effects(effect)
    theta = with_off_values(structure, parameters(free_rods(1, rod_contact=False), **numbers))
    made = {f"{effect.name}.{k}": torch.full_like(theta.extra[f"{effect.name}.{k}"], x) for k, x in values.items()}
    return structure, theta.with_values(made)

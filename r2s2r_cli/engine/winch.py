"""Winches: the motor command moves the rest length of its cable."""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


def commanded_rate(structure: Structure, theta: Parameters, u: Tensor, tension: Tensor) -> Tensor:
    """Winding rate that the command asks for [m/s], + shortens, (B, actuated); u in [-1, 1], +1 reels in.

    Droop: a loaded winch reels in slower by `droop` per newton, never backwards, and pays out as fast as without load.
    """
    u = torch.clamp(u, -1.0, 1.0)
    inward = u > 0
    rate = torch.where(inward, theta.speed_in, theta.speed_out) * u
    if structure.droop:
        rate = torch.where(inward, rate * torch.relu(1.0 - theta.droop * tension), rate)
    return rate


def lagged(theta: Parameters, winding: Tensor, rate: Tensor, h: Tensor) -> Tensor:
    """First-order lag towards `rate`, implicit in the step; with time constant 0 it is `rate`, bit by bit."""
    return rate + (winding - rate) * (theta.lag / (theta.lag + h))


def wound(theta: Parameters, rest: Tensor, winding: Tensor, h: Tensor) -> Tensor:
    """Rest length after h [m], kept between the winch's ends."""
    return torch.minimum(torch.maximum(rest - h * winding, theta.rest_min), theta.rest_max)

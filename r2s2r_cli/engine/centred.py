"""Rods whose centre of mass is not where the nominal model has it (effects of channel mass).

A state says where the origin of frame B is, which is the nominal centre of mass; the laws of motion hold about the true
one. The step goes there and back, so that start states, end caps and attachment points do not move with an effect.
"""

from __future__ import annotations

from dataclasses import replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.hooks import MassTerms, overrides
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import State, cable_ends
from r2s2r_cli.engine.structure import Structure


def weighed(structure: Structure, theta: Parameters) -> tuple[Parameters, Tensor | None]:
    """Parameters with the true masses, points from the true centres, and these centres, (B, rod, 3) [m], frame
    B; None where no effect moves them. theta: as `effective` makes it."""
    effects = overrides(structure, "mass")
    if not effects:
        return theta, None
    terms = MassTerms(theta.mass, theta.inertia, torch.zeros_like(theta.p_BE[..., 0, :]))
    for effect in effects:
        terms = effect.mass(theta.of(effect.name), terms)
    ends = cable_ends(structure, theta.mass.device)
    moved = replace(
        theta, mass=terms.mass, inertia=terms.inertia, p_BE=theta.p_BE - terms.centre[:, :, None],
        p_BS=theta.p_BS - terms.centre[:, ends],
    )  # fmt: skip
    return moved, terms.centre


def centred(structure: Structure, theta: Parameters, state: State) -> tuple[Parameters, State, Tensor | None]:
    """Parameters and state about the true centres of mass, and these as in `weighed`."""
    theta, centre = weighed(structure, theta)
    if centre is None:
        return theta, state, None
    R = roma.unitquat_to_rotmat(state.q_WR)
    spin = torch.linalg.cross(state.w_R, centre.expand_as(state.w_R))
    return theta, replace(state, p_WB=state.p_WB + _turned(R, centre), v_WB=state.v_WB + _turned(R, spin)), centre


def returned(state: State, centre: Tensor | None) -> State:
    """The state about the origins of the frames B again."""
    if centre is None:
        return state
    R = roma.unitquat_to_rotmat(state.q_WR)
    spin = torch.linalg.cross(state.w_R, centre.expand_as(state.w_R))
    return replace(state, p_WB=state.p_WB - _turned(R, centre), v_WB=state.v_WB - _turned(R, spin))


def _turned(R: Tensor, vector: Tensor) -> Tensor:
    return (R * vector[..., None, :]).sum(-1)

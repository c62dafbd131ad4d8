"""Cables: tension-only springs between two rods, with damping that cannot push (contact.md section 2, step 1)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, angular_change
from r2s2r_cli.engine.hooks import CableTerms, overrides
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import cable_ends
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class CableRows:
    """Geometry of all cables. direction: from end 0 to end 1, frame G, (B, cable, 3). arm: of the direction about each
    end's centre of mass, rod axes, (B, cable, 2, 3). length [m], rate [m/s], both (B, cable). mobility: velocity of
    the ends towards each other per impulse [1/kg], (B, cable)."""

    direction: Tensor
    arm: Tensor
    length: Tensor
    rate: Tensor
    mobility: Tensor


def cable_rows(structure: Structure, theta: Parameters, rods: Bodies) -> CableRows:
    """Geometry of all cables at the start of the step."""
    ends = cable_ends(structure, rods.p.device)
    R = rods.R_GR[:, ends]
    p_GS = rods.p[:, ends] + (R * theta.p_BS[..., None, :]).sum(-1)
    d = p_GS[:, :, 1] - p_GS[:, :, 0]
    length = torch.linalg.vector_norm(d, dim=-1)
    direction = d * (1.0 / length)[..., None]  # one division instead of three: they cost most in machine code
    along_R = (R * direction[:, :, None, :, None]).sum(-2)
    arm = torch.linalg.cross(theta.p_BS.expand_as(along_R), along_R)
    ends_v = (direction[:, :, None] * rods.v[:, ends]).sum(-1) + (arm * rods.w[:, ends]).sum(-1)
    turned = angular_change(rods.inverse_inertia[:, ends], arm)
    mobility = rods.inverse_mass[:, ends].sum((-2, -1)) + (arm * turned).sum((-2, -1))
    return CableRows(direction, arm, length, ends_v[..., 1] - ends_v[..., 0], mobility)


def rest_lengths(structure: Structure, theta: Parameters, winched: Tensor) -> Tensor:
    """Rest lengths of all cables [m], (B, cable), from those of the winched ones, (B, actuated)."""
    rest = spread(structure, winched, theta.rest)
    for effect in overrides(structure, "rest"):
        rest = effect.rest(theta.of(effect.name), rest)
    return rest


def spread(structure: Structure, winched: Tensor, passive: Tensor) -> Tensor:
    """Numbers of all cables, (B, cable), from those of the winched, (B, actuated), and of the passive ones."""
    place = {k: i for i, k in enumerate(structure.actuated)}
    offset = structure.n_actuated
    place.update({k: offset + i for i, k in enumerate(structure.passive)})
    both = torch.cat([winched, passive.expand(len(winched), -1)], dim=1)
    return both[:, [place[k] for k in range(structure.n_cables)]]


def spring_force(structure: Structure, theta: Parameters, rows: CableRows, rest: Tensor) -> CableTerms:
    """Stretch and spring force, sensor tendons not included. Slack cables have no force."""
    stretch = rows.length - rest
    pull, tangent = theta.stiffness * stretch, theta.stiffness
    if structure.cubic:
        pull = stretch * (theta.stiffness + stretch * (theta.stiffness2 + stretch * theta.stiffness3))
        tangent = tangent + stretch * (2.0 * theta.stiffness2 + stretch * (3.0 * theta.stiffness3))
    force = torch.where(stretch > 0, pull, torch.zeros_like(pull))
    winched = stretch.new_zeros(len(stretch), structure.n_actuated)
    passive = spread(structure, winched, torch.ones_like(theta.rest))
    return CableTerms(stretch, rows.rate, force, tangent.expand_as(stretch), passive)


def tension_impulse(
    structure: Structure, theta: Parameters, rows: CableRows, terms: CableTerms, force: Tensor, h: Tensor
) -> Tensor:
    """Impulse of every cable over h [N s], (B, cable), never negative.

    The damping alone is implicit, cable by cable: `damping / (1 + h damping mobility)` cannot overshoot, and being zero
    at rest it leaves the static equilibrium alone, which an implicit spring would not (contact.md section 6, trap 3).
    """
    damping = theta.damping / (1.0 + h * theta.damping * rows.mobility)
    taut = torch.relu(force + damping * rows.rate)
    impulse = h * torch.where(terms.stretch > 0, taut, torch.zeros_like(taut))
    if structure.tendons:
        impulse = impulse + h * theta.tendon_stiffness * torch.relu(rows.length - theta.tendon_rest)
    return impulse


def pulled(structure: Structure, rods: Bodies, rows: CableRows, impulse: Tensor) -> tuple[Tensor, Tensor]:
    """Changes of v and w of all rods, each (B, rod, 3), by the cables' impulses (B, cable)."""
    ends = cable_ends(structure, impulse.device)
    sign = torch.tensor([1.0, -1.0], dtype=impulse.dtype, device=impulse.device)
    incidence = torch.nn.functional.one_hot(ends, structure.n_rods).to(impulse.dtype) * sign[:, None]
    linear = torch.einsum("ker,bki->bri", incidence, rows.direction * impulse[..., None])
    angular = torch.einsum("ker,bkei->bri", incidence, rows.arm * impulse[..., None, None])
    return rods.inverse_mass * linear, angular_change(rods.inverse_inertia, angular)

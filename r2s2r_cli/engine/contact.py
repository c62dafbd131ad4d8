"""Ground contact by velocity-level impulses with true stiction (contact.md section 2, steps 3 to 8).

Rods touch each other only through cables and, rarely, through rod contact; the ground problem is therefore one problem
of two contacts a rod. This file sets it up and applies its solution, `friction_solve.py` solves it.
Six rows a rod, row 3 c + i: cap c in direction i of the ground frame G; i = 2 is the normal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, angular_change
from r2s2r_cli.engine.detach import detach_geometry
from r2s2r_cli.engine.hooks import ContactTerms, GroundTerms, Values, overrides
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Detach, Structure

PUSH_OUT = 0.2
"""Share of a penetration that one step takes back, in the pose alone."""


@dataclass(frozen=True)
class GroundRows:
    """The contact problem of all rods. gap [m], (B, rod, 2); arm: angular part of the rows, rod axes, (B, rod, 6, 3);
    mobility: velocity of row a per impulse on row b [1/kg], (B, rod, 6, 6); free: row velocities if nothing were
    touched [m/s], (B, rod, 6); target: normal velocity to reach [m/s], (B, rod, 2); active: the cap would be below the
    ground at the end of the step; toi: share of the step before its impact; friction: (B, rod, 2); between: unit
    direction from the contact point of the even cap to that of the odd one, (B, rod, 3). give: what of the mobility is
    the ground's own, not the rod's [1/kg], (B, rod, 2); None: nothing. gap and target are from a surface that has sunk.
    """

    gap: Tensor
    arm: Tensor
    mobility: Tensor
    free: Tensor
    target: Tensor
    active: Tensor
    toi: Tensor
    friction: Tensor
    between: Tensor
    give: Tensor | None = None


def contact_rows(
    structure: Structure, theta: Parameters, rods: Bodies, v: Tensor, w: Tensor, h: Tensor,
    memory: Mapping[str, Values] | None = None,
) -> GroundRows:  # fmt: skip
    """The contact problem at the start of the step, with the free velocities v, w that the step would end with.

    memory: own states of the effects, by effect; needed where one of them is a ground that gives way.
    """
    gap, arm = _geometry(theta, rods)
    arm = detach_geometry(arm, structure.detach == Detach.GEOMETRY)
    mobility = detach_geometry(_mobility(rods, arm), structure.detach == Detach.GEOMETRY)
    before = row_velocity(arm, rods.v, rods.w)
    free = row_velocity(arm, v, w)
    friction = theta.friction.expand(gap.shape)
    if structure.effects:
        terms = ContactTerms(ground_points(theta, rods), before.unflatten(-1, (2, 3)), gap)
        for effect in structure.effects:
            friction = effect.contact(theta.of(effect.name), terms, friction)
    v0, v1 = before[..., 2::3], free[..., 2::3]
    surface = None
    for effect in overrides(structure, "surface"):
        own = (memory or {})[effect.name]
        surface = effect.surface(theta.of(effect.name), own, surface or _plane(theta, rods, gap, mobility), h)
    if surface is not None:
        gap, v0, v1 = gap + surface.sunk, v0 - surface.rising, v1 - surface.rising
    # Predicted, not gap < 0: a cap at rest 1e-12 above the ground must stay active.
    active = gap + h[..., None] * v1 < 0
    falling = torch.where(active & (v1 < 0), -v1, torch.ones_like(v1))
    toi = torch.where(active, torch.relu(gap) / (h[..., None] * falling), torch.zeros_like(gap))
    target = _rebound(theta, v0, v1 - v0, toi)
    between = _between(theta, rods)
    if surface is None:
        return GroundRows(gap, arm, mobility, free, target, active, toi, friction, between)
    target, give, creep = target + surface.rising, surface.give.expand_as(gap), surface.creep.expand_as(gap)
    softer = torch.diag_embed(torch.stack([creep, creep, give], dim=-1).flatten(-2))
    return GroundRows(gap, arm, mobility + softer, free, target, active, toi, friction, between, give)


def ground_points(theta: Parameters, rods: Bodies) -> Tensor:
    """Ground points below the cap centres [m], frame G, (B, rod, 2, 3)."""
    p_GC = rods.p[:, :, None] + (rods.R_GR[:, :, None] * theta.p_BE[..., None, :]).sum(-1)
    return p_GC * p_GC.new_tensor([1.0, 1.0, 0.0])


def _plane(theta: Parameters, rods: Bodies, gap: Tensor, mobility: Tensor) -> GroundTerms:
    """A hard plane."""
    zero = torch.zeros_like(gap)
    turning = torch.linalg.cross(rods.w[:, :, None].expand(*gap.shape, 3), theta.p_BE.expand(*gap.shape, 3))
    # Of the centre, not of the lowest point: a cap that rolls moves over the ground as well.
    v_GC = rods.v[:, :, None] + (rods.R_GR[:, :, None] * turning[..., None, :]).sum(-1)
    along = torch.diagonal(mobility, dim1=-2, dim2=-1).unflatten(-1, (2, 3))
    v_GC = v_GC * v_GC.new_tensor([1.0, 1.0, 0.0])
    return GroundTerms(zero, zero, zero, zero, p_GC=ground_points(theta, rods), v_GC=v_GC, mobility=along)


def _rebound(theta: Parameters, v0: Tensor, gain: Tensor, toi: Tensor) -> Tensor:
    """Normal velocities after the step of caps that hit the ground with v0 at share `toi` of it; 0 at rest, or e = 0.

    gain: what gravity and cables add to v0 within the step.
    Departure: contact.md takes the speed at the time of impact. Velocities of this scheme belong to half steps, so that
    the impact comes half a step later: so a bounce is second-order accurate (1e-5 of e^2 h at 1 ms instead of 1 %).
    """
    ramp = torch.clamp(-(v0 + toi * gain) * (1.0 / theta.impact_speed)[..., None] - 1.0, 0.0, 1.0)
    rebound = theta.restitution[..., None] * ramp * torch.relu(-(v0 + (toi + 0.5) * gain))
    return torch.relu(rebound + torch.minimum(rebound, (0.5 - toi) * gain))


def _between(theta: Parameters, rods: Bodies) -> Tensor:
    """Unit direction between the contact points, (B, rod, 3): forces along it, equal and opposite, move nothing."""
    axis = (rods.R_GR * (theta.p_BE[..., 1, :] - theta.p_BE[..., 0, :])[..., None, :]).sum(-1)
    lower = theta.cap_radius[..., 1] - theta.cap_radius[..., 0]
    line = torch.cat([axis[..., :2], (axis[..., 2] - lower)[..., None]], dim=-1)
    return line * (1.0 / torch.sqrt((line * line).sum(-1, keepdim=True)))


def _geometry(theta: Parameters, rods: Bodies) -> tuple[Tensor, Tensor]:
    """Gaps (B, rod, 2) and angular rows (B, rod, 6, 3)."""
    R = rods.R_GR
    x, y, z = R.unbind(-2)  # axes of G in rod axes, (B, rod, 3)
    height = rods.p[..., 2, None] + (z[..., None, :] * theta.p_BE).sum(-1)
    gap = height - theta.cap_radius
    radius = theta.cap_radius[..., None]
    p_BE = theta.p_BE.expand(*z.shape[:2], 2, 3)

    def turning(axis: Tensor) -> Tensor:
        return torch.linalg.cross(p_BE, axis[..., None, :].expand_as(p_BE))

    # The arm of the lowest point: the sphere's own part, -r z x axis, is -r y, +r x and 0.
    rows = torch.stack([turning(x) - radius * y[..., None, :], turning(y) + radius * x[..., None, :], turning(z)], -2)
    return gap, rows.flatten(-3, -2)


def _mobility(rods: Bodies, arm: Tensor) -> Tensor:
    turned = angular_change(rods.inverse_inertia[:, :, None], arm)
    same = torch.eye(3, dtype=arm.dtype, device=arm.device).repeat(2, 2)
    whole = torch.einsum("brai,brci->brac", arm, turned) + rods.inverse_mass[..., None] * same
    # Symmetric by construction, so that the tracer computes one half only.
    return torch.tril(whole) + torch.tril(whole, -1).mT


def row_velocity(arm: Tensor, v: Tensor, w: Tensor) -> Tensor:
    """Velocity of every row [m/s], (B, rod, 6)."""
    return torch.cat([v, v], dim=-1) + (arm * w[..., None, :]).sum(-1)


def applied(rods: Bodies, ground: GroundRows, impulse: Tensor, v: Tensor, w: Tensor) -> tuple[Tensor, Tensor]:
    """Velocities after the ground impulses (B, rod, 6)."""
    linear = impulse[..., :3] + impulse[..., 3:]
    angular = (ground.arm * impulse[..., None]).sum(-2)
    return v + rods.inverse_mass * linear, w + angular_change(rods.inverse_inertia, angular)


def pose_velocity(
    rods: Bodies, ground: GroundRows, impulse: Tensor, v: Tensor, w: Tensor, h: Tensor
) -> tuple[Tensor, Tensor]:
    """What moves the pose: the new velocities v, w, but friction acting from the time of impact on, and caps that were
    stopped landing exactly on the ground; penetrations are pushed out. The pose alone moves so: no energy comes in.

    Departure: contact.md takes back each contact's own share of its impulse. Where one cap's impulse also stops the
    other, that overshoots: gaps of a micrometre changed sign and grew by 2.5 a step, and so did the tangent (1e13).
    """
    zero = torch.zeros_like(ground.gap[..., 0])
    late = torch.repeat_interleave(ground.toi, 3, dim=-1) * impulse
    late = torch.stack([late[..., 0], late[..., 1], zero, late[..., 3], late[..., 4], zero], dim=-1)
    along, turning = applied(rods, ground, -late, v, w)
    normal = ground.arm[..., 2::3, :]
    wanted = v[..., 2, None] + (normal * w[..., None, :]).sum(-1)
    wanted = (1.0 - ground.toi) * wanted + (1.0 / h)[..., None] * (
        PUSH_OUT * torch.relu(-ground.gap) - torch.relu(ground.gap)
    )
    missing = wanted - along[..., 2, None] - (normal * turning[..., None, :]).sum(-1)
    stopped = ground.active & (impulse[..., 2::3] > 0)
    missing = torch.where(stopped, missing, torch.zeros_like(missing))
    a, c = ground.mobility[..., 2, 2], ground.mobility[..., 5, 5]
    if ground.give is not None:
        a, c = a - ground.give[..., 0], c - ground.give[..., 1]
    b = torch.where(stopped[..., 0] & stopped[..., 1], ground.mobility[..., 5, 2], zero)
    scale = 1.0 / (a * c - b * b)
    first = (c * missing[..., 0] - b * missing[..., 1]) * scale
    second = (a * missing[..., 1] - b * missing[..., 0]) * scale
    correction = torch.stack([zero, zero, first, zero, zero, second], dim=-1)
    return applied(rods, ground, correction, along, turning)

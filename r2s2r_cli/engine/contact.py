"""Ground contact by velocity-level impulses with true stiction (contact.md section 2, steps 3 to 8).

Rods touch each other only through cables and, rarely, through rod contact; the ground problem is therefore one problem
of two contacts a rod: an exact stick solve, projected to the friction cone, then sweeps that know the slip direction.
Six rows a rod, row 3 c + i: cap c in direction i of the ground frame G; i = 2 is the normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, angular_change
from r2s2r_cli.engine.detach import detach_geometry, detach_impulse
from r2s2r_cli.engine.hooks import ContactTerms
from r2s2r_cli.engine.linear import ldl_solve
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Detach, Structure

REGULARISATION = 1e-7
"""Relative, on the stick solve's diagonal. Not 0: axial friction of a rod on both caps is redundant. Not more: 1e-4
creeps 0.1 mm a minute (contact.md section 6, trap 5)."""
SATURATED = 0.998
"""Share of the squared friction limit from which a contact counts as sliding."""
PAINLEVE_FLOOR = 0.3
"""Least share of the normal mobility that sliding may leave; keeps friction above 1.3 finite (trap 6)."""
PUSH_OUT = 0.2
"""Share of a penetration that one step takes back, in the pose alone."""


@dataclass(frozen=True)
class GroundRows:
    """The contact problem of all rods. gap [m], (B, rod, 2); arm: angular part of the rows, rod axes, (B, rod, 6, 3);
    mobility: velocity of row a per impulse on row b [1/kg], (B, rod, 6, 6); free: row velocities if nothing were
    touched [m/s], (B, rod, 6); target: normal velocity to reach [m/s], (B, rod, 2); active: the cap would be below the
    ground at the end of the step; toi: share of the step before its impact; friction: (B, rod, 2); between: horizontal
    direction from cap to cap, (B, rod, 2)."""

    gap: Tensor
    arm: Tensor
    mobility: Tensor
    free: Tensor
    target: Tensor
    active: Tensor
    toi: Tensor
    friction: Tensor
    between: Tensor


def contact_rows(structure: Structure, theta: Parameters, rods: Bodies, v: Tensor, w: Tensor, h: Tensor) -> GroundRows:
    """The contact problem at the start of the step, with the free velocities v, w that the step would end with."""
    gap, arm = _geometry(theta, rods)
    arm = detach_geometry(arm, structure.detach == Detach.GEOMETRY)
    mobility = detach_geometry(_mobility(rods, arm), structure.detach == Detach.GEOMETRY)
    before = row_velocity(arm, rods.v, rods.w)
    free = row_velocity(arm, v, w)
    friction = theta.friction.expand(gap.shape)
    if structure.effects:
        p_GC = rods.p[:, :, None] + (rods.R_GR[:, :, None] * theta.p_BE[..., None, :]).sum(-1)
        p_GC = p_GC * p_GC.new_tensor([1.0, 1.0, 0.0])
        terms = ContactTerms(p_GC, before.unflatten(-1, (2, 3)), gap)
        for effect in structure.effects:
            friction = effect.contact(theta.of(effect.name), terms, friction)
    v0, v1 = before[..., 2::3], free[..., 2::3]
    # Predicted, not gap < 0: a cap at rest 1e-12 above the ground must stay active.
    active = gap + h[..., None] * v1 < 0
    falling = torch.where(v1 < 0, -v1, torch.ones_like(v1))
    toi = torch.where(active, torch.relu(gap) / (h[..., None] * falling), torch.zeros_like(gap))
    target = _rebound(theta, v0, v1 - v0, toi)
    return GroundRows(gap, arm, mobility, free, target, active, toi, friction, _between(theta, rods))


def _rebound(theta: Parameters, v0: Tensor, gain: Tensor, toi: Tensor) -> Tensor:
    """Normal velocities after the step of caps that hit the ground with v0 at share `toi` of it; 0 at rest, and at e = 0.

    gain: what gravity and cables add to v0 within the step.
    Departure: contact.md takes the speed at the time of impact. Velocities of this scheme belong to half steps, so that
    the impact comes half a step later: with it a bounce is second-order accurate (1e-5 of e^2 h at 1 ms instead of 1 %).
    """
    ramp = torch.clamp(-(v0 + toi * gain) * (1.0 / theta.impact_speed)[..., None] - 1.0, 0.0, 1.0)
    rebound = theta.restitution[..., None] * ramp * torch.relu(-(v0 + (toi + 0.5) * gain))
    return torch.relu(rebound + torch.minimum(rebound, (0.5 - toi) * gain))


def _between(theta: Parameters, rods: Bodies) -> Tensor:
    """Horizontal unit direction from the even to the odd cap, (B, rod, 2); 0 for a vertical rod."""
    axis = (rods.R_GR * (theta.p_BE[..., 1, :] - theta.p_BE[..., 0, :])[..., None, :]).sum(-1)[..., :2]
    squared = (axis * axis).sum(-1, keepdim=True)
    level = squared > 1e-12
    return torch.where(level, axis * (1.0 / torch.sqrt(torch.where(level, squared, torch.ones_like(squared)))), 0.0)


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


def solve(structure: Structure, ground: GroundRows) -> Tensor:
    """Contact impulses [N s], (B, rod, 6): never pulling, in the friction cone, with stiction."""
    residual = torch.cat([_aim(ground, 0), _aim(ground, 1)], dim=-1)
    impulse = _stick(ground, residual)
    residual = residual + (ground.mobility * impulse[..., None, :]).sum(-1)
    problem = (ground.mobility, ground.friction, ground.active)
    impulse = sweep(*problem, impulse, residual, sweeps=structure.sweeps)
    return detach_impulse(impulse, structure.detach == Detach.IMPULSE)


def _aim(ground: GroundRows, cap: int) -> Tensor:
    free = ground.free[..., 3 * cap : 3 * cap + 3]
    return torch.cat([free[..., :2], (free[..., 2] - ground.target[..., cap])[..., None]], dim=-1)


def _stick(ground: GroundRows, residual: Tensor) -> Tensor:
    """Impulses that stop every active row, each contact then projected to its friction cone."""
    mask = ground.active.repeat_interleave(3, dim=-1)
    both = mask[..., :, None] & mask[..., None, :]
    diagonal = torch.diagonal(ground.mobility, dim1=-2, dim2=-1)
    matrix = torch.where(both, ground.mobility, torch.zeros_like(ground.mobility))
    lower = torch.tril(matrix, -1)
    full = ldl_solve(lower, diagonal * (1.0 + REGULARISATION), torch.where(mask, -residual, torch.zeros_like(residual)))
    full = _shared(ground, full)
    parts = []
    for cap in (0, 1):
        normal = torch.relu(full[..., 3 * cap + 2])
        parts += [*clip(full[..., 3 * cap], full[..., 3 * cap + 1], ground.friction[..., cap] * normal), normal]
    return torch.stack(parts, dim=-1)


def _shared(ground: GroundRows, full: Tensor) -> Tensor:
    """Impulses along the line between two touching caps, shared as their normals are.

    Equal and opposite ones along that line move nothing, and the solve splits them evenly; a cap with little load would
    then be clipped although the pair can hold, and the rod would creep near its friction limit (0.3 mm/s; now 1e-7).
    """
    dx, dy = ground.between.unbind(-1)
    first, second = torch.relu(full[..., 2]), torch.relu(full[..., 5])
    both = ground.active[..., 0] & ground.active[..., 1] & (first + second > 0)
    share = first / torch.where(both, first + second, torch.ones_like(first))
    along = full[..., 0] * dx + full[..., 1] * dy
    total = along + full[..., 3] * dx + full[..., 4] * dy
    shift = torch.where(both, total * share - along, torch.zeros_like(along))
    sx, sy, zero = shift * dx, shift * dy, torch.zeros_like(shift)
    return full + torch.stack([sx, sy, zero, -sx, -sy, zero], dim=-1)


def clip(x: Tensor, y: Tensor, limit: Tensor) -> tuple[Tensor, Tensor]:
    """The tangential impulse (x, y) scaled back to `limit` where it is longer."""
    squared = x * x + y * y
    beyond = squared > limit * limit
    scale = torch.where(beyond, limit / torch.sqrt(torch.where(beyond, squared, torch.ones_like(squared))), 1.0)
    return x * scale, y * scale


def sweep(
    mobility: Tensor, friction: Tensor, active: Tensor, impulse: Tensor, residual: Tensor, *, sweeps: int
) -> Tensor:
    """Impulses (..., 6) after slip-aware Gauss-Seidel sweeps over the two contacts of a rod.

    residual: row velocities less their targets at `impulse`, (..., 6); the rest as in GroundRows.
    """
    rows = list(impulse.unbind(-1))
    for k in range(sweeps):
        for cap in (0, 1) if k % 2 == 0 else (1, 0):
            rows, residual = _relax(mobility, friction[..., cap], active[..., cap], cap, rows, residual)
    return torch.stack(rows, dim=-1)


def _relax(
    a: Tensor, mu: Tensor, active: Tensor, cap: int, rows: list[Tensor], residual: Tensor
) -> tuple[list[Tensor], Tensor]:
    i, j, n = 3 * cap, 3 * cap + 1, 3 * cap + 2
    x, y, normal = rows[i], rows[j], rows[n]
    zero = torch.zeros_like(normal)
    limit, squared = mu * normal, x * x + y * y
    slipping = squared > SATURATED * limit * limit
    # Where nothing slips or pushes there is no direction; 1 keeps the division finite.
    moving = slipping & (squared > 0)
    inverse = 1.0 / torch.sqrt(torch.where(moving, squared, torch.ones_like(squared)))
    dx, dy = torch.where(moving, x * inverse, zero), torch.where(moving, y * inverse, zero)

    # Normal: a sliding contact moves along its ray of the cone, so friction takes part in what the normal can do.
    stiff = a[..., n, n]
    ray = torch.maximum(stiff + mu * (a[..., i, n] * dx + a[..., j, n] * dy), PAINLEVE_FLOOR * stiff)
    pushed = torch.relu(normal - residual[..., n] / torch.where(moving, ray, stiff))
    pushed = torch.where(active, pushed, zero)
    change = pushed - normal
    sx, sy = mu * change * dx, mu * change * dy
    residual = residual + a[..., :, n] * change[..., None] + a[..., :, i] * sx[..., None] + a[..., :, j] * sy[..., None]
    x, y = x + sx, y + sy

    # Friction: a scalar step, the larger eigenvalue of the 2 x 2 block; its inverse would turn the slip direction.
    mean, half = 0.5 * (a[..., i, i] + a[..., j, j]), 0.5 * (a[..., i, i] - a[..., j, j])
    rate = 1.0 / (mean + torch.sqrt(half * half + a[..., i, j] * a[..., i, j] + 1e-20))
    fx, fy = clip(x - residual[..., i] * rate, y - residual[..., j] * rate, mu * pushed)
    fx, fy = torch.where(active, fx, zero), torch.where(active, fy, zero)
    residual = residual + a[..., :, i] * (fx - x)[..., None] + a[..., :, j] * (fy - y)[..., None]
    rows = list(rows)
    rows[i], rows[j], rows[n] = fx, fy, pushed
    return rows, residual


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
    b = torch.where(stopped[..., 0] & stopped[..., 1], ground.mobility[..., 5, 2], zero)
    scale = 1.0 / (a * c - b * b)
    first = (c * missing[..., 0] - b * missing[..., 1]) * scale
    second = (a * missing[..., 1] - b * missing[..., 0]) * scale
    correction = torch.stack([zero, zero, first, zero, zero, second], dim=-1)
    return applied(rods, ground, correction, along, turning)

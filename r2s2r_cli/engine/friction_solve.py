"""The ground problem of every rod: an exact stick solve, projected to the friction cone, then sweeps that know the slip
direction (contact.md section 2, steps 5 and 6; section 3 has what else was tried).
"""

from __future__ import annotations

import torch
from torch import Tensor

from r2s2r_cli.engine.contact import GroundRows
from r2s2r_cli.engine.detach import detach_impulse
from r2s2r_cli.engine.linear import ldl_solve
from r2s2r_cli.engine.structure import Detach, Structure

REGULARISATION = 1e-7
"""Relative, on the stick solve's diagonal. Not 0: axial friction of a rod on both caps is redundant. Not more: 1e-4
creeps 0.1 mm a minute (contact.md section 6, trap 5)."""
SATURATED = 0.998
"""Share of the squared friction limit from which a contact counts as sliding."""
PAINLEVE_FLOOR = 0.3
"""Least share of the normal mobility that sliding may leave; keeps friction above 1.3 finite (trap 6)."""


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

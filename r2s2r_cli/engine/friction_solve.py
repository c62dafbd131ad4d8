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
TINY = 1e-30
"""[N^2 s^2] squared friction impulse below which it has no direction."""
SATURATED = 0.998
"""Share of the squared friction limit from which a contact counts as sliding."""
PAINLEVE_FLOOR = 0.3
"""Least share of the normal mobility that sliding may leave; keeps friction above 1.3 finite (trap 6)."""


def solve(structure: Structure, ground: GroundRows) -> Tensor:
    """Contact impulses [N s], (B, rod, 6): never pulling, in the friction cone, with stiction."""
    residual = torch.cat([_aim(ground, 0), _aim(ground, 1)], dim=-1)
    impulse, slip = _stick(ground, residual)
    residual = residual + (ground.mobility * impulse[..., None, :]).sum(-1)
    problem = (ground.mobility, ground.friction, ground.active)
    impulse = sweep(*problem, impulse, slip, residual, sweeps=structure.sweeps)
    return detach_impulse(impulse, structure.detach == Detach.IMPULSE)


def _aim(ground: GroundRows, cap: int) -> Tensor:
    free = ground.free[..., 3 * cap : 3 * cap + 3]
    return torch.cat([free[..., :2], (free[..., 2] - ground.target[..., cap])[..., None]], dim=-1)


def _stick(ground: GroundRows, residual: Tensor) -> tuple[Tensor, list[Tensor]]:
    """Impulses that stop every active row, each contact then projected to its friction cone, and their slip.

    Where both caps touch, equal and opposite impulses along the line between them move nothing: the matrix has rank 5.
    It is deflated in that direction. Targets that no rigid rod can meet (both caps bounce, the rod is tilted by 1e-3)
    would otherwise be answered with a hundred times the impulse of the impact.
    """
    mask = ground.active.repeat_interleave(3, dim=-1)
    a = ground.mobility
    pair = (ground.active[..., 0] & ground.active[..., 1])[..., None]
    null = torch.where(pair, torch.cat([ground.between, -ground.between], dim=-1), torch.zeros_like(residual))
    weighted = 0.5 * (a[..., 0, 0] + a[..., 3, 3])[..., None] * null
    matrix = torch.where(mask[..., :, None] & mask[..., None, :], a, torch.zeros_like(a))
    lower = torch.tril(matrix + weighted[..., :, None] * null[..., None, :], -1)
    diagonal = torch.diagonal(a, dim1=-2, dim2=-1) * (1.0 + REGULARISATION) + weighted * null
    full = ldl_solve(lower, diagonal, torch.where(mask, -residual, torch.zeros_like(residual)))
    full = _shared(ground, full)
    parts, slip = [], []
    for cap in (0, 1):
        normal = torch.relu(full[..., 3 * cap + 2])
        x, y, *way = clip(full[..., 3 * cap], full[..., 3 * cap + 1], ground.friction[..., cap] * normal)
        parts += [x, y, normal]
        slip += way
    return torch.stack(parts, dim=-1), slip


def _shared(ground: GroundRows, full: Tensor) -> Tensor:
    """Friction along the line between two touching caps, shared as their normals are.

    The solve splits it evenly; a cap with little load would then be clipped although the pair can hold, and the rod
    would creep near its friction limit (0.3 mm/s; now 1e-7). Shifted along the line itself, it changes no velocity.
    """
    first, second = torch.relu(full[..., 2]), torch.relu(full[..., 5])
    level = (ground.between[..., :2] * ground.between[..., :2]).sum(-1)
    both = ground.active[..., 0] & ground.active[..., 1] & (first + second > 0) & (level > 0.5)
    share = first / torch.where(both, first + second, torch.ones_like(first))
    along = (full[..., :2] * ground.between[..., :2]).sum(-1)
    total = along + (full[..., 3:5] * ground.between[..., :2]).sum(-1)
    by = (total * share - along) * (1.0 / torch.where(both, level, torch.ones_like(level)))
    shift = torch.where(both, by, torch.zeros_like(by))[..., None] * ground.between
    return full + torch.cat([shift, -shift], dim=-1)


def clip(x: Tensor, y: Tensor, limit: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The tangential impulse (x, y) scaled back to `limit` where it is longer, and its unit direction, 0 where none."""
    squared = x * x + y * y
    some = squared > TINY
    inverse = 1.0 / torch.sqrt(torch.where(some, squared, torch.ones_like(squared)))
    zero = torch.zeros_like(squared)
    ux, uy = torch.where(some, x * inverse, zero), torch.where(some, y * inverse, zero)
    beyond = squared > limit * limit
    return torch.where(beyond, limit * ux, x), torch.where(beyond, limit * uy, y), ux, uy


def directions(impulse: Tensor) -> list[Tensor]:
    """The slip of impulses (..., 6): unit directions of the friction of both caps, as `sweep` takes them."""
    unlimited = torch.full_like(impulse[..., 0], torch.inf)
    return [way for cap in (0, 1) for way in clip(impulse[..., 3 * cap], impulse[..., 3 * cap + 1], unlimited)[2:]]


def sweep(
    mobility: Tensor,
    friction: Tensor,
    active: Tensor,
    impulse: Tensor,
    slip: list[Tensor],
    residual: Tensor,
    *,
    sweeps: int,
) -> Tensor:
    """Impulses (..., 6) after slip-aware Gauss-Seidel sweeps over the two contacts of a rod.

    slip: unit directions of the friction of both caps, four numbers; carried along, since a root and a division each
    time would cost more than all else. residual: row velocities less their targets at `impulse`, (..., 6); the rest as
    in GroundRows.
    """
    rows, slip = list(impulse.unbind(-1)), list(slip)
    for k in range(sweeps):
        rows, residual = _press(mobility, friction, active, rows, slip, residual)
        for cap in (0, 1) if k % 2 == 0 else (1, 0):
            rows, slip, residual = _drag(mobility, friction[..., cap], active[..., cap], cap, rows, slip, residual)
    return torch.stack(rows, dim=-1)


def _press(
    a: Tensor, mu: Tensor, active: Tensor, rows: list[Tensor], slip: list[Tensor], residual: Tensor
) -> tuple[list[Tensor], Tensor]:
    """Both normal impulses at once. A sliding contact moves along its ray of the cone, so that friction takes part in
    what the normal can do.

    One after the other they would leave 1 % of the slip of a rod on both caps as a normal velocity, step after step.
    """
    rays = [_ray(a, mu[..., cap], cap, rows, slip) for cap in (0, 1)]
    first, second = active.unbind(-1)
    zero = torch.zeros_like(rows[2])
    m00 = torch.maximum(rays[0][..., 2], PAINLEVE_FLOOR * a[..., 2, 2])
    m11 = torch.maximum(rays[1][..., 5], PAINLEVE_FLOOR * a[..., 5, 5])
    both = first & second
    m01, m10 = torch.where(both, rays[1][..., 2], zero), torch.where(both, rays[0][..., 5], zero)
    # Normal velocities without the normal impulses; none where there is no contact.
    q0 = torch.where(first, residual[..., 2] - m00 * rows[2] - m01 * rows[5], zero)
    q1 = torch.where(second, residual[..., 5] - m10 * rows[2] - m11 * rows[5], zero)
    # The floor counts from the determinant without friction, which is small by itself for a rod heavy in its middle.
    across = torch.where(both, a[..., 5, 2], zero)
    plain = a[..., 2, 2] * a[..., 5, 5] - across * across
    scale = 1.0 / torch.maximum(m00 * m11 - m01 * m10, PAINLEVE_FLOOR * plain)
    n0, n1 = (m01 * q1 - m11 * q0) * scale, (m10 * q0 - m00 * q1) * scale
    # Where one of them would pull, that one is 0 and the other bears alone.
    alone0, alone1 = torch.relu(-q0 / m00), torch.relu(-q1 / m11)
    p0 = torch.where(n1 < 0, alone0, torch.relu(n0))
    p1 = torch.where(n0 < 0, torch.where(n1 < 0, torch.relu(-(q1 + m10 * p0) / m11), alone1), torch.relu(n1))
    rows = list(rows)
    for cap, pushed in ((0, p0), (1, p1)):
        change = pushed - rows[3 * cap + 2]
        x, y = rays[cap][..., 6], rays[cap][..., 7]
        rows[3 * cap : 3 * cap + 3] = rows[3 * cap] + change * x, rows[3 * cap + 1] + change * y, pushed
        residual = residual + rays[cap][..., :6] * change[..., None]
    return rows, residual


def _ray(a: Tensor, mu: Tensor, cap: int, rows: list[Tensor], slip: list[Tensor]) -> Tensor:
    """Velocity of each row per normal impulse of a cap, and the friction that comes with it, (..., 6 + 2)."""
    x, y, normal = rows[3 * cap : 3 * cap + 3]
    zero = torch.zeros_like(normal)
    limit, squared = mu * normal, x * x + y * y
    moving = (squared > SATURATED * limit * limit) & (squared > TINY)
    dx = torch.where(moving, mu * slip[2 * cap], zero)
    dy = torch.where(moving, mu * slip[2 * cap + 1], zero)
    i, j, n = 3 * cap, 3 * cap + 1, 3 * cap + 2
    ray = a[..., :, n] + a[..., :, i] * dx[..., None] + a[..., :, j] * dy[..., None]
    return torch.cat([ray, dx[..., None], dy[..., None]], dim=-1)


def _drag(
    a: Tensor, mu: Tensor, active: Tensor, cap: int, rows: list[Tensor], slip: list[Tensor], residual: Tensor
) -> tuple[list[Tensor], list[Tensor], Tensor]:
    """Friction of one cap: a scalar step, the larger eigenvalue of the 2 x 2 block; its inverse would turn the slip."""
    i, j = 3 * cap, 3 * cap + 1
    x, y, pushed = rows[3 * cap : 3 * cap + 3]
    mean, half = 0.5 * (a[..., i, i] + a[..., j, j]), 0.5 * (a[..., i, i] - a[..., j, j])
    rate = 1.0 / (mean + torch.sqrt(half * half + a[..., i, j] * a[..., i, j] + 1e-20))
    fx, fy, ux, uy = clip(x - residual[..., i] * rate, y - residual[..., j] * rate, mu * pushed)
    fx, fy = torch.where(active, fx, torch.zeros_like(x)), torch.where(active, fy, torch.zeros_like(y))
    residual = residual + a[..., :, i] * (fx - x)[..., None] + a[..., :, j] * (fy - y)[..., None]
    rows, slip = list(rows), list(slip)
    rows[i], rows[j], slip[2 * cap], slip[2 * cap + 1] = fx, fy, ux, uy
    return rows, slip, residual

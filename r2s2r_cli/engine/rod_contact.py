"""Collisions between two rods: shafts as capsules, caps as spheres, one contact a pair and step, the nearest.

Rare in every gait and large, hence guarded: the machine code branches round it. Where two rods touch, their contact and
the ground contacts of both are relaxed in turn; a third rod that touches one of them in the same step comes after.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, angular_change
from r2s2r_cli.engine.contact import PUSH_OUT, GroundRows, applied
from r2s2r_cli.engine.friction_solve import clip, directions, sweep
from r2s2r_cli.engine.guarded import guarded
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.rod_gap import candidates, near, nearest
from r2s2r_cli.engine.structure import Structure

ROUNDS = 3
"""Of pair contact, ground of the one, ground of the other."""
_TINY = 1e-12


@dataclass(frozen=True)
class Collision:
    """Velocities v, w and ground impulses after all collisions, and what they move the poses by besides, as a velocity:
    shift (B, rod, 3) [m/s] and turn (B, rod, 3) [rad/s]."""

    v: Tensor
    w: Tensor
    impulse: Tensor
    shift: Tensor
    turn: Tensor


def collide(
    structure: Structure,
    theta: Parameters,
    rods: Bodies,
    ground: GroundRows,
    impulse: Tensor,
    v: Tensor,
    w: Tensor,
    h: Tensor,
) -> Collision:
    """Collisions of all pairs of rods. v, w: velocities before the ground impulses (B, rod, 6)."""
    v, w = applied(rods, ground, impulse, v, w)
    if not structure.rod_pairs:
        return Collision(v, w, impulse, torch.zeros_like(v), torch.zeros_like(w))
    vs, ws, ls = list(v.unbind(1)), list(w.unbind(1)), list(impulse.unbind(1))
    shifts, turns = [torch.zeros_like(x) for x in vs], [torch.zeros_like(x) for x in ws]
    ends = rods.p[:, :, None] + (rods.R_GR[:, :, None] * theta.p_BE[..., None, :]).sum(-1)
    axis = theta.p_BE[..., 1, :] - theta.p_BE[..., 0, :]
    squares = (axis * axis).sum(-1)
    solver = partial(_relax_pair, structure.axial)
    for i, j in structure.rod_pairs:
        radii = _radii(theta, i, j, len(v))
        when = near(ends[:, i], ends[:, j], (squares[:, i], squares[:, j]), radii, h)
        velocities = (vs[i], ws[i], vs[j], ws[j])
        still = (shifts[i], turns[i], shifts[j], turns[j])
        bodies = (*_body(structure, rods, ground, ends, i), *_body(structure, rods, ground, ends, j))
        common = (
            radii,
            *(x.expand(len(v), -1) for x in (theta.restitution, theta.impact_speed, theta.rod_friction, h)),
        )
        otherwise = (*velocities, ls[i], ls[j], *still)
        solved = guarded(when, solver, (*otherwise, *bodies, *common), otherwise)
        vs[i], ws[i], vs[j], ws[j], ls[i], ls[j], shifts[i], turns[i], shifts[j], turns[j] = solved
    return Collision(*(torch.stack(x, dim=1) for x in (vs, ws, ls, shifts, turns)))


def _radii(theta: Parameters, i: int, j: int, batch: int) -> Tensor:
    """Radii of shaft and caps of both rods [m], (B, 6)."""
    parts = [theta.rod_radius[:, [i]], theta.cap_radius[:, i], theta.rod_radius[:, [j]], theta.cap_radius[:, j]]
    return torch.cat(parts, dim=1).expand(batch, -1)


def _body(structure: Structure, rods: Bodies, ground: GroundRows, ends: Tensor, i: int) -> tuple[Tensor, ...]:
    inverse = rods.inverse_inertia[:, i]
    inverse = torch.diagonal(inverse, dim1=-2, dim2=-1) if structure.axial else inverse.flatten(1)
    batch = len(rods.p)
    kept = (
        ends[:, i], rods.p[:, i], rods.R_GR[:, i], rods.inverse_mass[:, i], inverse, ground.arm[:, i],
        ground.mobility[:, i], ground.target[:, i], ground.active[:, i].to(ends.dtype), ground.friction[:, i],
    )  # fmt: skip
    return tuple(x.expand(batch, *x.shape[1:]) for x in kept)


_BODY = 10
"""Tensors that _body hands over."""


def _relax_pair(axial: bool, *inputs: Tensor) -> tuple[Tensor, ...]:
    """One pair: velocities, ground impulses, pose shifts in; the same out."""
    va, wa, vb, wb, la, lb, shift_a, turn_a, shift_b, turn_b = inputs[:10]
    one, two = _Rod(axial, *inputs[10 : 10 + _BODY]), _Rod(axial, *inputs[10 + _BODY : 10 + 2 * _BODY])
    radii, restitution, threshold, friction, h = inputs[10 + 2 * _BODY :]
    s, t, r_a, r_b = nearest(*candidates(one.ends, two.ends, radii))
    x = one.ends[:, 0] + s * (one.ends[:, 1] - one.ends[:, 0])
    y = two.ends[:, 0] + t * (two.ends[:, 1] - two.ends[:, 0])
    d = y - x
    # Axes that cross have no direction between them: up, then, and the push-out does the rest.
    apart = (d * d).sum(-1, keepdim=True)
    crossed = apart < _TINY
    distance = torch.sqrt(torch.where(crossed, torch.ones_like(apart), apart))
    normal = torch.where(crossed, torch.cat([torch.zeros_like(apart), apart * 0.0, apart * 0.0 + 1.0], 1), d / distance)
    gap = torch.where(crossed, torch.zeros_like(apart), distance) - r_a - r_b
    # Rows: the normal and two directions across it; arms of the points where the surfaces meet.
    across = torch.where(normal[:, [0]].abs() < 0.6, torch.ones_like(gap), torch.zeros_like(gap))
    axis = torch.cat([across, 1.0 - across, torch.zeros_like(gap)], dim=1)
    first = torch.linalg.cross(normal, axis)
    first = first / torch.sqrt((first * first).sum(-1, keepdim=True))
    rows = torch.stack([normal, first, torch.linalg.cross(normal, first)], dim=1)
    arm_a, arm_b = one.arms(x + r_a * normal, rows), two.arms(y - r_b * normal, rows)
    mobility = one.mobility(arm_a) + two.mobility(arm_b)
    mobility = (
        mobility + torch.eye(3, dtype=gap.dtype, device=gap.device) * (one.inverse_mass + two.inverse_mass)[..., None]
    )

    def relative() -> Tensor:
        turning = (arm_b * wb[:, None]).sum(-1) - (arm_a * wa[:, None]).sum(-1)
        return (rows * (vb - va)[:, None]).sum(-1) + turning

    before = relative()[:, [0]]
    active = gap + h * before < 0
    speed = torch.where(active & (before < 0), -before, torch.ones_like(before))
    toi = torch.where(active, torch.relu(gap) / (h * speed), torch.zeros_like(gap))
    target = torch.where(active, restitution * torch.clamp((-before - threshold) / threshold, 0.0, 1.0) * -before, 0.0)
    stiff = mobility[:, 0, 0, None]
    tangent = 1.0 / (mobility[:, 1, 1] + mobility[:, 2, 2])[:, None]  # at least the larger eigenvalue's inverse
    push = torch.zeros_like(gap)
    slide = torch.zeros_like(before.expand(-1, 2))
    for _ in range(ROUNDS):
        u = relative()
        pushed = torch.where(active, torch.relu(push - (u[:, [0]] - target) / stiff), torch.zeros_like(push))
        u = u + mobility[:, :, 0] * (pushed - push)
        wish = slide - u[:, 1:] * tangent
        sx, sy, _, _ = clip(wish[:, 0], wish[:, 1], friction[:, 0] * pushed[:, 0])
        slid = torch.where(active, torch.stack([sx, sy], dim=1), torch.zeros_like(slide))
        change = torch.cat([pushed - push, slid - slide], dim=1)
        push, slide = pushed, slid
        va, wa = one.kicked(va, wa, rows, arm_a, -change)
        vb, wb = two.kicked(vb, wb, rows, arm_b, change)
        la, va, wa = one.grounded(la, va, wa)
        lb, vb, wb = two.grounded(lb, vb, wb)
    whole = torch.cat([push, slide], dim=1)
    back = torch.zeros_like(whole[:, 1:])
    correction = torch.cat([(PUSH_OUT / h) * torch.relu(-gap) / stiff, back], dim=1) - toi * whole
    shift_a, turn_a = one.kicked(shift_a, turn_a, rows, arm_a, -correction)
    shift_b, turn_b = two.kicked(shift_b, turn_b, rows, arm_b, correction)
    return va, wa, vb, wb, la, lb, shift_a, turn_a, shift_b, turn_b


class _Rod:
    """One rod of a pair, batch first without a rod axis."""

    def __init__(self, axial: bool, *kept: Tensor) -> None:
        self.ends, self.p, self.R_GR, self.inverse_mass, inverse, *ground = kept
        self.inverse_inertia = torch.diag_embed(inverse) if axial else inverse.reshape(-1, 3, 3)
        self.arm, self.reach, self.target, active, self.friction = ground
        self.active = active > 0.5

    def arms(self, point: Tensor, rows: Tensor) -> Tensor:
        """Arms of the rows (B, 3, 3) at a point, rod axes."""
        lever = (point - self.p)[:, None].expand_as(rows)
        turning = torch.linalg.cross(lever, rows)
        return (turning[:, :, :, None] * self.R_GR[:, None]).sum(2)

    def mobility(self, arm: Tensor) -> Tensor:
        """Angular part of the velocity of rows per impulse, (B, 3, 3)."""
        return torch.einsum("bai,bci->bac", arm, angular_change(self.inverse_inertia[:, None], arm))

    def kicked(self, v: Tensor, w: Tensor, rows: Tensor, arm: Tensor, impulse: Tensor) -> tuple[Tensor, Tensor]:
        """v, w after an impulse (B, 3) along the rows."""
        linear, angular = (rows * impulse[..., None]).sum(1), (arm * impulse[..., None]).sum(1)
        return v + self.inverse_mass * linear, w + angular_change(self.inverse_inertia, angular)

    def grounded(self, impulse: Tensor, v: Tensor, w: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """One more sweep over the rod's ground contacts, from the velocities v, w that it has now."""
        zero = torch.zeros_like(self.target[:, :1])
        aim = torch.cat([zero, zero, self.target[:, :1], zero, zero, self.target[:, 1:]], dim=1)
        residual = torch.cat([v, v], dim=-1) + (self.arm * w[:, None]).sum(-1) - aim
        after = sweep(self.reach, self.friction, self.active, impulse, directions(impulse), residual, sweeps=1)
        change = after - impulse
        v = v + self.inverse_mass * (change[:, :3] + change[:, 3:])
        return after, v, w + angular_change(self.inverse_inertia, (self.arm * change[..., None]).sum(1))

"""An independent integration of the engine's equations, written from the equations and sharing no code with the step.

The ground is a stiff spring (2e5 N/m) with a damper that makes landings plastic, friction is Coulomb's law regularised
below 0.1 mm/s, steps are 2 us, semi-implicit. The state holds the angular momentum in the world, where the engine holds
the angular velocity in rod axes. Bodies of revolution on level ground, e = 0, no rod contact, no effects. Compiled by
the engine's tracer, which knows no physics: 1 s is 500,000 steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure
from r2s2r_cli.engine.native import NativeStep

STIFFNESS = 2e5
"""Of the ground [N/m]: a robot of 4 N sinks in by 10 um."""
DAMPING = 300.0
"""Of the ground [N s/m]: critical or more for every effective mass of a cap, 0.05 to 0.13 kg."""
SLIP = 1e-4
"""[m/s] below it friction falls linearly to 0."""
STEP = 2e-6
"""[s]"""


@dataclass(frozen=True)
class Penalty:
    """The equations of one robot. Numbers of batch 1 only."""

    structure: Structure
    theta: Parameters

    def __post_init__(self) -> None:
        if len(self.theta.mass) != 1 or self.structure.lag or self.structure.droop or self.structure.effects:
            raise ValueError("the penalty integration knows one robot, without lag, droop and effects")

    def step(self, s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        """One step: s (B, 13 rods + winches) of positions, quaternions, momenta, angular momenta and rest lengths."""
        theta, n, batch = self.theta, self.structure.n_rods, len(s)
        x, q, P, L = (part.reshape(batch, n, -1) for part in s[:, : 13 * n].split([3 * n, 4 * n, 3 * n, 3 * n], dim=1))
        rest = s[:, 13 * n :]
        R = _matrix(q)
        v = P / theta.mass[..., None]
        w = _spin(R, L, theta)

        force = theta.mass[..., None] * theta.gravity[:, None] + torch.zeros_like(x)
        torque = torch.zeros_like(x)
        for end in (0, 1):
            arm = (R * theta.p_BE[:, :, None, end]).sum(-1)
            push, at = self._ground(x + arm, arm, v, w, theta.cap_radius[..., end], theta.friction[..., end] * p, h)
            force, torque = force + push, torque + _cross(at, push)
        pulls = self._cables(x, R, v, w, rest)
        force = torch.stack([force[:, i] + sum(f for r, f, _ in pulls if r == i) for i in range(n)], dim=1)
        torque = torch.stack([torque[:, i] + sum(t for r, _, t in pulls if r == i) for i in range(n)], dim=1)

        P, L = P + h[..., None] * force, L + h[..., None] * torque
        x = x + h[..., None] * P / theta.mass[..., None]
        q = q + 0.5 * h[..., None] * _rate(q, _spin(R, L, theta))
        q = q / (q * q).sum(-1, keepdim=True).sqrt()
        speed = torch.where(u > 0, theta.speed_in, theta.speed_out) * u.clamp(-1.0, 1.0)
        rest = (rest - h * speed).maximum(theta.rest_min).minimum(theta.rest_max)
        return torch.cat([x.flatten(1), q.flatten(1), P.flatten(1), L.flatten(1), rest], dim=1)

    def _ground(
        self, cap: Tensor, arm: Tensor, v: Tensor, w: Tensor, radius: Tensor, mu: Tensor, h: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Force on a cap at its lowest point, and that point from the centre of mass, each (B, rod, 3)."""
        theta = self.theta
        down = torch.stack([torch.zeros_like(radius), torch.zeros_like(radius), -radius], dim=-1)
        at = arm + down
        slip = v + _cross(w, at)
        depth = radius - cap[..., 2]
        spring = STIFFNESS * depth - DAMPING * slip[..., 2]
        normal = torch.where((depth > 0) & (spring > 0), spring, torch.zeros_like(spring))
        # Explicit friction must not turn a slip round within a step: in hard impacts it is regularised further.
        length = (theta.p_BE[..., 1, 2] - theta.p_BE[..., 0, 2]) / 2 + radius
        inertia = theta.inertia.diagonal(dim1=-2, dim2=-1)
        mobility = 1.0 / theta.mass + length**2 / inertia[..., 0] + radius**2 / inertia[..., 2]
        least = (h * mobility * mu * normal).clamp(min=SLIP)
        speed = (slip[..., 0] ** 2 + slip[..., 1] ** 2 + 1e-30).sqrt().maximum(least)
        share = -mu * normal / speed
        return torch.stack([share * slip[..., 0], share * slip[..., 1], normal], dim=-1), at

    def _cables(self, x: Tensor, R: Tensor, v: Tensor, w: Tensor, rest: Tensor) -> list[tuple[int, Tensor, Tensor]]:
        """Rod, force on it and torque about its centre of mass, for both ends of every cable."""
        theta, pulls = self.theta, []
        for k, (a, b) in enumerate(self.structure.cable_rods):
            arm_a = (R[:, a] * theta.p_BS[:, k, 0, None]).sum(-1)
            arm_b = (R[:, b] * theta.p_BS[:, k, 1, None]).sum(-1)
            d = x[:, b] + arm_b - x[:, a] - arm_a
            length = (d * d).sum(-1, keepdim=True).sqrt()
            n = d / length
            rate = (n * (v[:, b] + _cross(w[:, b], arm_b) - v[:, a] - _cross(w[:, a], arm_a))).sum(-1, keepdim=True)
            winched = k in self.structure.actuated
            free = rest[:, [self.structure.actuated.index(k)]] if winched else theta.rest[:, [self._passive(k)]]
            e = length - free
            spring = theta.stiffness[:, [k]] * e + theta.stiffness2[:, [k]] * e**2 + theta.stiffness3[:, [k]] * e**3
            whole = spring + theta.damping[:, [k]] * rate
            tension = torch.where((e > 0) & (whole > 0), whole, torch.zeros_like(whole))
            pulls += [(a, tension * n, _cross(arm_a, tension * n)), (b, -tension * n, -_cross(arm_b, tension * n))]
        return pulls

    def _passive(self, k: int) -> int:
        return self.structure.passive.index(k)

    def caps(self, start: State, commands: Tensor, *, seconds: float, frames: int) -> Tensor:
        """End caps p_WE [m], (B, frames + 1, cap, 3), at even times over all commands (B, K, actuated), each held for
        `seconds`."""
        s0 = self.flat(start)
        hold = round(seconds / STEP)
        s = self.kernels().forward(
            s0, commands, torch.ones(1, 1, dtype=s0.dtype), h=STEP, hold=hold, every=hold * commands.shape[1] // frames
        )
        return self.caps_of(s)

    def kernels(self) -> NativeStep:
        """The compiled equations."""
        n = 13 * self.structure.n_rods + self.structure.n_actuated
        return NativeStep(self.step, n, self.structure.n_actuated, 1, key="penalty")

    def flat(self, start: State) -> Tensor:
        """The state of these equations, (B, 13 rods + winches)."""
        R = _matrix(start.q_WR)
        spin = (R * start.w_R[..., None, :]).sum(-1)
        inertia = R @ self.theta.inertia @ R.mT
        L = (inertia * spin[..., None, :]).sum(-1)
        P = self.theta.mass[..., None] * start.v_WB
        return torch.cat([x.flatten(1) for x in (start.p_WB, start.q_WR, P, L, start.rest)], dim=1)

    def caps_of(self, s: Tensor) -> Tensor:
        """End caps (..., cap, 3) of flat states (..., 13 rods + winches)."""
        n = self.structure.n_rods
        x, q = s[..., : 3 * n].unflatten(-1, (n, 3)), s[..., 3 * n : 7 * n].unflatten(-1, (n, 4))
        arms = (_matrix(q)[..., None, :, :] * self.theta.p_BE[0, :, :, None, :]).sum(-1)
        return (x[..., None, :] + arms).flatten(-3, -2)


def _matrix(q: Tensor) -> Tensor:
    """Rotation matrix of unit quaternions xyzw, (..., 3, 3): w^2 - u.u on the diagonal, plus 2 u u^T + 2 w [u]x."""
    x, y, z, w = q.unbind(-1)
    rows = [
        w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z,
    ]  # fmt: skip
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def _spin(R: Tensor, L: Tensor, theta: Parameters) -> Tensor:
    """Angular velocity in the world of bodies of revolution: L / It across the axis, L / Ia along it."""
    axis = R[..., 2]
    inertia = theta.inertia.diagonal(dim1=-2, dim2=-1)
    along = (axis * L).sum(-1, keepdim=True) * axis
    return along / inertia[..., 2:] + (L - along) / inertia[..., :1]


def _rate(q: Tensor, w: Tensor) -> Tensor:
    """The product (w, 0) q of quaternions xyzw: twice the rate of q at the angular velocity w of the world."""
    u, s = q[..., :3], q[..., 3:]
    return torch.cat([s * w + _cross(w, u), -(w * u).sum(-1, keepdim=True)], dim=-1)


def _cross(a: Tensor, b: Tensor) -> Tensor:
    (a0, a1, a2), (b0, b1, b2) = a.unbind(-1), b.unbind(-1)
    return torch.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], dim=-1)

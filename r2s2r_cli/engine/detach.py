"""Detached contact: the paper's Algorithms 1 to 3 to the letter, their corrected forms, and what the step uses.

`Tensor.detach` is called in this file and nowhere else in the physics. Source: the paper, section "Detachment Approach
for Contact Gradients" (Algorithms 1, 2) and the appendix (Algorithm 3, the rule of actuated bodies). The idea: a
passive contact force answers every push with an equal and opposite one, so the derivative of a body that cannot move
is zero and an optimiser stops; without the derivative of the response, the *trend* of the push remains.

Conventions of the algorithms: one point mass a batch element; x height [m] or position, v [m/s], force [N] without
gravity, up positive, each of shape (...). e restitution, mu friction coefficient, mass [kg], gravity [m/s^2] (a
positive number), dt [s], ground [m]: numbers or tensors that broadcast. They return (x, v) one step later.
`detach=False` leaves the graph whole, for the paper's comparisons. Nothing is validated: these are formulas, not an
interface of the robot.
"""

from __future__ import annotations

from enum import StrEnum

import torch
from torch import Tensor

Number = float | Tensor


class DetachBodies(StrEnum):
    """Whose contact response is detached in a collision of an actuated body with a passive one."""

    NONE = "none"
    ACTUATED = "actuated"
    """The paper's rule: the trend of the actuated body is kept, the passive one is reached through the contact."""
    ALL = "all"
    """Nothing reaches the passive body: zero gradient."""


def detach_geometry(x: Tensor, on: bool) -> Tensor:
    """Contact arms and inverse masses of the step, as constants where `on` (`Detach.GEOMETRY`)."""
    return x.detach() if on else x


def detach_impulse(x: Tensor, on: bool) -> Tensor:
    """A contact impulse of the step, as a constant where `on` (`Detach.IMPULSE`; bounded only well below 1 s)."""
    return x.detach() if on else x


def _cut(x: Tensor, on: bool) -> Tensor:
    return x.detach() if on else x


def algorithm_1(
    x: Tensor, v: Tensor, force: Tensor, *, e: Number, mass: Number, gravity: Number, dt: Number,
    ground: float = 0.0, detach: bool = True,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Algorithm 1 as printed: restitution.

    Known defects: the impulse acts in free flight too (no test of contact or approach stands before it), so that v
    becomes -e v' everywhere, and with e = 0 a drone never leaves the ground whatever its force. The text says that
    dx/de is zero without detachment; it is -v' dt either way. `restitution` repairs the impulse.
    """
    # fmt: off
    v_new = v - gravity * dt + force / mass * dt       # v'_{t+1} = v_t - g dt + F/m dt
    dv = -(1 + e) * _cut(v_new, detach)                # dv = -(1+e) v'_{t+1}.detach()
    v_next = v_new + dv                                # v_{t+1} = v'_{t+1} + dv
    dx = ground - x                                    # if x_t < ground: dx = ground - x_t
    pushed = x + v_next * dt + _cut(dx, detach)        #   x_{t+1} = x_t + v_{t+1} dt + dx.detach()
    free = x + v_next * dt                             # else: x_{t+1} = x_t + v_{t+1} dt
    return torch.where(x < ground, pushed, free), v_next
    # fmt: on


def restitution(
    x: Tensor, v: Tensor, force: Tensor, *, e: Number, mass: Number, gravity: Number, dt: Number,
    ground: float = 0.0, detach: bool = True,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Algorithm 1, corrected.

    Derivatives in contact: detached dv/dF = dt/m, dv/dv = 1, dv/de = -v', dx/dx = 1; whole dv/dF = -e dt/m,
    dv/dv = -e, dv/de = -v' (the same), dx/dx = 0 below the ground.

    Departure: the impulse is guarded by contact (x <= ground) and approach (v' < 0), else it would act in free flight.
    """
    v_new = v - gravity * dt + force / mass * dt
    contact = (x <= ground) & (v_new < 0)
    dv = -(1 + e) * _cut(v_new, detach)
    v_next = torch.where(contact, v_new + dv, v_new)
    dx = torch.relu(ground - x)
    return x + v_next * dt + _cut(dx, detach), v_next


def algorithm_2(
    x: Tensor, v: Tensor, force: Tensor, *, mu: Tensor, normal: Number, mass: Number, dt: Number, detach: bool = True
) -> tuple[Tensor, Tensor]:
    """Algorithm 2 as printed: Coulomb friction on a line. normal: contact force N [N]. `detach=False` is the plain law.

    Known defects: the static term gives dv/dmu = -N dt/m in either direction; for a force to the left (F < 0) more
    friction would make the box move left. There is no form for two directions. `friction` repairs both.
    """
    # fmt: off
    v_new = v + force / mass * dt                      # v'_{t+1} = v_t + F/m dt
    dv = -_cut(v_new, detach)                          # dv = -v'_{t+1}.detach()
    dp = mu * normal * dt / mass                       # dp_f = mu N dt / m
    slips = dv.abs() > dp                              # if |dv| > dp_f:
    sliding = dv * dp / _nonzero(dv.abs())             #   dv = dv dp_f / |dv|
    sticking = dv - dp + dp.detach() if detach else dv  # else: dv = dv - dp_f + dp_f.detach()
    dv = torch.where(slips, sliding, sticking)
    v_next = v + force / mass * dt + dv                # v_{t+1} = v_t + F/m dt + dv
    return x + v_next * dt, v_next                     # x_{t+1} = x_t + v_{t+1} dt
    # fmt: on


def friction(
    x: Tensor, v: Tensor, force: Tensor, *, mu: Tensor, normal: Number, mass: Number, dt: Number, detach: bool = True
) -> tuple[Tensor, Tensor]:
    """Algorithm 2, corrected, in one or two directions: x, v, force of shape (..., d); mu, normal, mass of shape (...).

    With the direction d = v'/|v'| that the body would take, detached derivatives are dv/dF = dt/m and
    dv/dmu = -N dt/m d, both in slip and in stick. Whole, in stick, both are zero.

    Departure: the static term acts along d, so that its sign is right for every direction of the force, and in 2-D.
    """
    v_new = v + force * _column(dt) / _column(mass)
    speed = torch.linalg.vector_norm(v_new, dim=-1)
    direction = _cut(v_new / _nonzero(speed).unsqueeze(-1), detach)
    dp = mu * normal * dt / mass
    sliding = -dp.unsqueeze(-1) * direction
    sticking = -_cut(v_new, detach)
    if detach:
        sticking = sticking - (dp - dp.detach()).unsqueeze(-1) * direction
    v_next = v_new + torch.where((speed > dp).unsqueeze(-1), sliding, sticking)
    return x + v_next * _column(dt), v_next


def algorithm_3(
    x: Tensor, v: Tensor, force: Tensor, *, e: Number, mass: Number, gravity: Number, dt: Number,
    ground: float = 0.0, detach: bool = True,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Algorithm 3 as printed: restitution with time of impact.

    Known defects: the impulse acts in free flight too, as in Algorithm 1. `- toi dv` alone puts the body at
    ground + v (dt - toi); dx is counted on top of it, so a bounce is wrong by |v'| (dt - toi) (first order) and a ball
    with e = 0 ends above the ground. toi comes from v_t, not v', and is not bounded by dt: just after the apex
    (v_t = 0) it is 10^4 s/m times the height. `restitution_toi` repairs these.
    """
    # fmt: off
    v_new = v - gravity * dt + force / mass * dt       # v'_{t+1} = v_t - g dt + F/m dt
    x_new = x + v_new * dt                             # x'_{t+1} = x_t + v'_{t+1} dt
    dv = -(1 + e) * _cut(v_new, detach)                # dv = -(1+e) v'_{t+1}.detach()
    v_next = v_new + dv                                # v_{t+1} = v'_{t+1} + dv
    toi = (x - ground) / torch.clamp(-v, min=1e-4)     # if x_t > ground: toi = (x_t - ground) / max(-v_t, 10^-4)
    toi = _cut(toi, detach)                            #   toi = toi.detach()
    toi = torch.where(x > ground, toi, torch.zeros_like(toi))  # else: toi = 0
    dx = ground - x_new                                # if x'_{t+1} < ground: dx = ground - x'_{t+1}
    bounced = x + v_next * dt + _cut(dx, detach) - toi * dv  # x_{t+1} = x_t + v_{t+1} dt + dx.detach() - toi dv
    free = x + v_next * dt                             # else: x_{t+1} = x_t + v_{t+1} dt
    return torch.where(x_new < ground, bounced, free), v_next
    # fmt: on


def restitution_toi(
    x: Tensor, v: Tensor, force: Tensor, *, e: Number, mass: Number, gravity: Number, dt: Number,
    ground: float = 0.0, detach: bool = True,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Algorithm 3, corrected: a bounce at the time of impact f dt, 0 <= f < 1.

    With the velocity at impact v_imp = v + f (v' - v), detached derivatives are dv/dF = dt/m and dv/de = -v_imp, the
    latter also whole (while the ball bounces). The whole graph holds the derivative of f, hence of the impact time.

    Departure: contact and approach guard the impulse. The position is corrected once: up to the impact with v', after
    it with the velocity of the bounce; only a body that starts below the ground is lifted. f comes from v', which
    moves the body, and ends with the step. What force and gravity do after the impact is kept (last term of `bounce`):
    without it the derivative of the flight after a bounce has the wrong sign at every step size.
    """
    v_new = v - gravity * dt + force / mass * dt
    hit = (x + v_new * dt < ground) & (v_new < 0)
    fall = torch.where(hit, -v_new * dt, torch.ones_like(v_new))
    f = _cut(torch.relu(x - ground) / fall, detach)
    before, change = _cut(v, detach), _cut(v_new - v, detach)
    bounce = torch.relu(-e * (before + f * change) + (1 - f) * change)
    dv = torch.where(hit, bounce - _cut(v_new, detach), torch.zeros_like(v_new))
    dx = torch.relu(ground - x)
    return x + (v_new + (1 - f) * dv) * dt + _cut(dx, detach), v_new + dv


def collision(
    v_A: Tensor, v_B: Tensor, touch: Tensor, *, e: Number, mass_A: Number, mass_B: Number, bodies: DetachBodies
) -> tuple[Tensor, Tensor]:
    """Velocities after a central collision of A (actuated, on the left) with B (passive), on a line.

    touch: bool, where the two meet in this step. Algorithm 1 with the approach v_A - v_B in the place of v', and the
    choice of detachment by body (the paper's appendix, billiards). Departure: guarded by contact and approach. An
    approach of exactly zero counts, so that the trend of a body that is held still passes to what it touches.
    """
    approach = v_A - v_B
    meets = touch & (approach >= 0)
    reduced = (1 + e) * mass_A * mass_B / (mass_A + mass_B)
    on_A = reduced * _cut(approach, bodies is not DetachBodies.NONE)
    on_B = reduced * _cut(approach, bodies is DetachBodies.ALL)
    return torch.where(meets, v_A - on_A / mass_A, v_A), torch.where(meets, v_B + on_B / mass_B, v_B)


def _nonzero(x: Tensor) -> Tensor:
    """The non-negative x with zeros replaced by 1: guards the input of a division whose result is not used."""
    return torch.where(x > 0, x, torch.ones_like(x))


def _column(x: Number) -> Number:
    return x.unsqueeze(-1) if isinstance(x, Tensor) and x.dim() else x

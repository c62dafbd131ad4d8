"""One step of the engine: cables, free motion, ground impulses, rod contact, winches. Pure torch, batch first.

The order follows contact.md section 2: everything is taken from the state at the start of the step; velocities change
by impulses, and positions follow the new velocities, less the part of the step before each impact.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, angular_change, bodies, gyroscopic, moved
from r2s2r_cli.engine.cable import cable_rows, pulled, rest_lengths, spring_force, tension_impulse
from r2s2r_cli.engine.centred import centred, returned
from r2s2r_cli.engine.contact import contact_rows, ground_points, pose_velocity
from r2s2r_cli.engine.friction_solve import solve
from r2s2r_cli.engine.hooks import MotorTerms, Values, WorldTerms, effective, overrides
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.rod_contact import collide
from r2s2r_cli.engine.state import State
from r2s2r_cli.engine.structure import Structure
from r2s2r_cli.engine.winch import commanded_rate, lagged, wound


def step(structure: Structure, theta: Parameters, state: State, u: Tensor, h: Tensor) -> State:
    """The state after one step of h seconds.

    theta: batch B or 1. u: motor commands in [-1, 1], +1 reels in, (B, actuated). h: (B, 1) or (1, 1) [s].
    Frame G throughout: z up from the ground plane. Differentiable; `Structure.detach` says what of.
    """
    theta = effective(structure, theta)
    memory: dict[str, Values] = {effect.name: state.of(effect.name) for effect in structure.effects}
    theta, about, centre = centred(structure, theta, state)
    rods = bodies(theta, about, axial=structure.axial)

    for effect in structure.effects:
        u, memory[effect.name] = effect.command(theta.of(effect.name), memory[effect.name], u, h)

    rows = cable_rows(structure, theta, rods)
    terms = spring_force(structure, theta, rows, rest_lengths(structure, theta, state.rest))
    force = terms.force
    for effect in structure.effects:
        force, memory[effect.name] = effect.cable(
            theta.of(effect.name), memory[effect.name], replace(terms, force=force), h
        )
    impulse = tension_impulse(structure, theta, rows, terms, force, h)
    dv, dw = pulled(structure, rods, rows, impulse)

    v = rods.v + h[..., None] * theta.gravity[:, None] + dv
    spin = gyroscopic(theta, rods.inverse_inertia, rods.w, h)
    w = rods.w + spin + dw
    if structure.effects:
        v, w = _pushed_by_the_world(structure, theta, memory, rods, v, w, h)

    ground = contact_rows(structure, theta, rods, v, w, h, memory)
    contact = solve(structure, ground)
    after = collide(structure, theta, rods, ground, contact, v, w, h)
    along, turning = pose_velocity(rods, ground, after.impulse, after.v, after.w, h)
    # The pose turns with the mean of w over what the gyroscopic torque does: angular momentum to second order.
    p_GB, q_GR = moved(about, along + after.shift, turning + after.turn - 0.5 * spin, h)

    tension = impulse[:, list(structure.actuated)] / h
    winding = commanded_rate(structure, theta, u, tension)
    for effect in structure.effects:
        load = MotorTerms(torch.clamp(u, -1.0, 1.0), tension, state.rest, theta.rest_max - state.rest)
        winding, memory[effect.name] = effect.motor(theta.of(effect.name), memory[effect.name], winding, load, h)
    for effect in overrides(structure, "landed"):
        force = after.impulse[..., 2::3] / h[..., None]
        memory[effect.name] = effect.landed(theta.of(effect.name), memory[effect.name], force, h)
    if structure.lag:
        winding = lagged(theta, state.winding, winding, h)
    rest = wound(theta, state.rest, winding, h)
    extra = {f"{name}.{key}": value for name, values in memory.items() for key, value in values.items()}
    return returned(State(p_GB, q_GR, after.v, after.w, rest, winding, extra), centre)


def _pushed_by_the_world(
    structure: Structure, theta: Parameters, memory: dict[str, Values], rods: Bodies, v: Tensor, w: Tensor, h: Tensor
) -> tuple[Tensor, Tensor]:
    terms = WorldTerms(rods.p, v, rods.R_GR, w, rods.w, rods.inverse_inertia, rods.inverse_mass)
    force, torque = torch.zeros_like(v), torch.zeros_like(w)
    for effect in structure.effects:
        force, torque = effect.world(theta.of(effect.name), terms, force, torque)
        torque = effect.resist(theta.of(effect.name), memory[effect.name], terms, torque, h)
    for effect in overrides(structure, "push"):
        zero = torch.zeros_like(rods.p)[:, :, None].expand(-1, -1, 2, -1)
        sideways = effect.push(theta.of(effect.name), memory[effect.name], ground_points(theta, rods), zero)
        own = (rods.R_GR.mT[:, :, None] * sideways[..., None, :]).sum(-1)
        force = force + sideways.sum(-2)
        torque = torque + torch.linalg.cross(theta.p_BE.expand_as(own), own).sum(-2)
    dv = h[..., None] * rods.inverse_mass * force
    return v + dv, w + angular_change(rods.inverse_inertia, h[..., None] * torque)

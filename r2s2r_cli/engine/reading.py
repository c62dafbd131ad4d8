"""What one reads off a state: cable lengths, tensions, ground forces, energy. Torch, batch first."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.batch import common_batch, tensors_of
from r2s2r_cli.engine.body import angular_change, bodies, gyroscopic
from r2s2r_cli.engine.cable import cable_rows, pulled, rest_lengths, spring_force, tension_impulse
from r2s2r_cli.engine.centred import centred, weighed
from r2s2r_cli.engine.contact import contact_rows
from r2s2r_cli.engine.friction_solve import solve
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import State, cable_ends
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class Reading:
    """What a state feels. length: between attachment points [m], rest: without tension [m], tension [N], sensor tendons
    included, each (B, cable). ground: force on each cap [N], frame G, (B, cap, 3). gap: of each cap [m], (B, cap)."""

    length: Tensor
    rest: Tensor
    tension: Tensor
    ground: Tensor
    gap: Tensor


def read(structure: Structure, theta: Parameters, state: State, h: float = 1e-3) -> Reading:
    """Tensions and ground forces of a state in frame G, as a step of h seconds would apply them. Effects that act on
    parameters, cable forces and friction are included."""
    dt = state.p_WB.new_full((1, 1), h)
    theta, state, _ = centred(structure, effective(structure, theta), state)
    memory = {effect.name: state.of(effect.name) for effect in structure.effects}
    rods = bodies(theta, state, axial=structure.axial)
    rows = cable_rows(structure, theta, rods)
    rest = rest_lengths(structure, theta, state.rest)
    terms = spring_force(structure, theta, rows, rest)
    force = terms.force
    for effect in structure.effects:
        force, _ = effect.cable(theta.of(effect.name), memory[effect.name], replace(terms, force=force), dt)
    impulse = tension_impulse(structure, theta, rows, terms, force, dt)
    dv, dw = pulled(structure, rods, rows, impulse)
    v = rods.v + h * theta.gravity[:, None] + dv
    w = rods.w + gyroscopic(theta, rods.inverse_inertia, rods.w, dt) + dw
    ground = contact_rows(structure, theta, rods, v, w, dt, memory)
    pushed = solve(structure, ground).unflatten(-1, (2, 3)) / h
    return Reading(rows.length, rest, impulse / h, pushed.flatten(1, 2), ground.gap.flatten(1))


def cap_lengths(cable_caps: tuple[tuple[int, int], ...], p_WE: Tensor) -> Tensor:
    """Distance between the two end caps of each cable [m], (..., cable), from end caps (..., cap, 3)."""
    ends = torch.tensor(cable_caps, dtype=torch.long, device=p_WE.device).reshape(-1, 2)
    return torch.linalg.vector_norm(p_WE[..., ends[:, 1], :] - p_WE[..., ends[:, 0], :], dim=-1)


def energy(structure: Structure, theta: Parameters, state: State) -> Tensor:
    """Kinetic, gravitational and elastic energy [J], (B,); frame G. Effects count as far as they change parameters."""
    theta, state, _ = centred(structure, effective(structure, theta), state)
    rods = bodies(theta, state, axial=structure.axial)
    kinetic = 0.5 * (theta.mass[..., None] * rods.v * rods.v).sum((-2, -1))
    kinetic = kinetic + 0.5 * torch.einsum(
        "bri,brij,brj->b", rods.w, theta.inertia.expand(len(rods.w), -1, -1, -1), rods.w
    )
    potential = -(theta.mass[..., None] * theta.gravity[:, None] * rods.p).sum((-2, -1))
    rows = cable_rows(structure, theta, rods)
    x = torch.relu(rows.length - rest_lengths(structure, theta, state.rest))
    elastic = 0.5 * theta.stiffness * x**2
    if structure.cubic:
        elastic = elastic + theta.stiffness2 * x**3 / 3 + theta.stiffness3 * x**4 / 4
    if structure.tendons:
        elastic = elastic + 0.5 * theta.tendon_stiffness * torch.relu(rows.length - theta.tendon_rest) ** 2
    return kinetic + potential + elastic.sum(-1)


def momentum(theta: Parameters, state: State) -> tuple[Tensor, Tensor]:
    """Linear [N s] and angular momentum about the origin [N m s] of all rods, frame G, each (B, 3)."""
    p = theta.mass[..., None] * state.v_WB
    spin = torch.einsum("brij,brj->bri", theta.inertia.expand(len(p), -1, -1, -1), state.w_R)
    spin = torch.einsum("brij,brj->bri", roma.unitquat_to_rotmat(state.q_WR), spin)
    return p.sum(1), (spin + torch.linalg.cross(state.p_WB, p)).sum(1)


def always_stable_step(structure: Structure, theta: Parameters) -> float:
    """A lower bound of `longest_step` [s] in every pose: the trace bounds the largest eigenvalue, and no cable's arm
    about an axis of its rod is longer than its attachment point is away from it."""
    if structure.n_cables == 0 or structure.cubic or structure.tendons or not structure.axial:
        return 0.0
    with torch.no_grad():
        theta, _ = weighed(structure, effective(structure, theta))
        ends = cable_ends(structure, theta.mass.device)
        squared = theta.p_BS * theta.p_BS
        across = (squared[..., 0] + squared[..., 1]) / theta.inertia[:, ends, 2, 2]
        mobility = 1.0 / theta.mass[:, ends] + across + squared.sum(-1) / theta.inertia[:, ends, 0, 0]
        most = float((theta.stiffness * mobility.sum(-1)).sum(-1).max())
    return 1.1 / most**0.5


def longest_step(structure: Structure, theta: Parameters, state: State) -> float:
    """The longest step [s] at which the explicit cables are stable at this state: 1.1 / sqrt of the largest eigenvalue
    of K^1/2 W K^1/2, W the mobility between all cables (contact.md section 2). Infinite without cables."""
    if structure.n_cables == 0:
        return float("inf")
    with torch.no_grad():
        batch = common_batch(tensors_of(theta))
        if len(state.p_WB) < batch:  # one start for a batch of robots
            state = state.select(torch.zeros(batch, dtype=torch.long, device=state.p_WB.device))
        theta, state, _ = centred(structure, effective(structure, theta), state)
        rods = bodies(theta, state, axial=structure.axial)
        rows = cable_rows(structure, theta, rods)
        stretch = torch.relu(rows.length - rest_lengths(structure, theta, state.rest))
        stiffness = theta.stiffness.expand_as(stretch)
        if structure.cubic:
            stiffness = stiffness + 2 * theta.stiffness2 * stretch + 3 * theta.stiffness3 * stretch**2
        if structure.tendons:
            stiffness = stiffness + theta.tendon_stiffness
        ends = cable_ends(structure, stretch.device)
        # Rows of every cable over all rods, and the same times the inverse masses: their product is the mobility.
        batch, rods_n = rods.p.shape[:2]
        jacobian = rows.arm.new_zeros(batch, structure.n_cables, rods_n, 6)
        every = torch.arange(structure.n_cables, device=stretch.device)
        for end, sign in ((0, 1.0), (1, -1.0)):
            jacobian[:, every, ends[:, end], :3] = sign * rows.direction
            jacobian[:, every, ends[:, end], 3:] = sign * rows.arm[:, :, end]
        turned = angular_change(rods.inverse_inertia[:, None], jacobian[..., 3:])
        heavy = torch.cat([rods.inverse_mass[:, None] * jacobian[..., :3], turned], dim=-1)
        root = torch.sqrt(torch.relu(stiffness))
        matrix = root[..., :, None] * (jacobian.flatten(2) @ heavy.flatten(2).mT) * root[..., None, :]
        largest = float(torch.linalg.eigvalsh(0.5 * (matrix + matrix.mT))[..., -1].max())
    return 1.1 / largest**0.5 if largest > 0 else float("inf")


def stable_substeps(structure: Structure, theta: Parameters, state: State, step: float) -> int:
    """Engine steps per `step` [s] that keep explicit stiff cables stable at this state (see `longest_step`)."""
    return max(1, math.ceil(step / longest_step(structure, theta, state) - 1e-9))

"""Static balance: the cable tensions and ground forces that hold a robot in a pose, as far as it can be held."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from r2s2r_cli.engine.body import Bodies, bodies
from r2s2r_cli.engine.cable import CableRows, cable_rows, rest_lengths, spring_force
from r2s2r_cli.engine.centred import centred
from r2s2r_cli.engine.contact import contact_rows
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.nnls import nnls
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import State
from r2s2r_cli.engine.structure import Structure

TOUCHING = 0.003
"""[m] a cap lower than this may be carried by the ground."""
LEVER = 0.1
"""[m] torques are weighed against forces at this arm."""
SHRINK = 1e-3
"""Weight of the tensions themselves, against those that pull at each other without moving anything."""


@dataclass(frozen=True)
class Balance:
    """tension: of all cables [N], (B, cable); ground: force on each cap [N], frame G, (B, cap, 3);
    unbalanced: what is left over, root mean square over rods [N], torques counted at an arm of 0.1 m, (B,)."""

    tension: Tensor
    ground: Tensor
    unbalanced: Tensor


def balance(structure: Structure, theta: Parameters, state: State, *, loose: Tensor | None = None) -> Balance:
    """Tensions of the winched cables (at least 0) and ground forces (pushing only) with the least unbalanced force.

    loose: winched cables that are known to pull at nothing, (B, actuated) bool.
    Passive cables pull as their lengths say. Frame G; velocities are ignored; friction is not limited here, because
    what slides is for the simulation to decide.
    """
    still = replace(state, v_WB=torch.zeros_like(state.v_WB), w_R=torch.zeros_like(state.w_R))
    with torch.no_grad():
        theta, still, _ = centred(structure, effective(structure, theta), still)
        rods = bodies(theta, still, axial=structure.axial)
        rows = cable_rows(structure, theta, rods)
        passive = spring_force(structure, theta, rows, rest_lengths(structure, theta, still.rest)).force
        if structure.tendons:
            passive = passive + theta.tendon_stiffness * torch.relu(rows.length - theta.tendon_rest)
        winched = list(structure.actuated)
        own = passive.clone()
        own[:, winched] = passive[:, winched] * 0.0
        if structure.tendons:
            own[:, winched] = (theta.tendon_stiffness * torch.relu(rows.length - theta.tendon_rest))[:, winched]
        cables = _cable_wrenches(structure, rods, rows)
        pulling = cables[..., winched] if loose is None else cables[..., winched] * ~loose[:, None]
        matrix = torch.cat([pulling, _ground_wrenches(structure, theta, rods)], dim=-1)
        weight = (theta.mass[..., None] * theta.gravity[:, None]).expand_as(rods.p)
        load = torch.cat([weight, torch.zeros_like(rods.w)], dim=-1).flatten(1) + (cables * own[:, None]).sum(-1)
        x = nnls(matrix, load, free=_free(structure).to(matrix.device), shrink=SHRINK)
        left = (load + (matrix * x[:, None]).sum(-1)).unflatten(1, (-1, 6))
    tension = own.clone()
    tension[:, winched] += x[:, : len(winched)]
    ground = x[:, len(winched) :].unflatten(1, (-1, 3))
    return Balance(tension, ground, torch.sqrt((left * left).sum(-1).mean(-1)))


def _cable_wrenches(structure: Structure, rods: Bodies, rows: CableRows) -> Tensor:
    """Force (G) and torque (rod axes, over LEVER) on every rod per newton of each cable, (B, 6 rods, cable)."""
    batch, n = len(rods.p), structure.n_cables
    wrench = rods.p.new_zeros(batch, structure.n_rods, 6, n)
    for k, ends in enumerate(structure.cable_rods):
        for end, (rod, sign) in enumerate(zip(ends, (1.0, -1.0), strict=True)):
            wrench[:, rod, :3, k] += sign * rows.direction[:, k]
            wrench[:, rod, 3:, k] += sign * rows.arm[:, k, end] / LEVER
    return wrench.flatten(1, 2)


def _ground_wrenches(structure: Structure, theta: Parameters, rods: Bodies) -> Tensor:
    """The same per newton of ground force along each axis of G on each cap, zero where a cap is in the air."""
    dt = rods.p.new_full((1, 1), 1e-3)
    rows = contact_rows(replace(structure, effects=()), theta, rods, rods.v, rods.w, dt)
    batch, n = len(rods.p), structure.n_rods
    wrench = rods.p.new_zeros(batch, n, 6, n, 2, 3)
    near = (rows.gap < TOUCHING).to(rods.p.dtype)
    unit = torch.eye(3, dtype=rods.p.dtype, device=rods.p.device)
    arm = rows.arm.unflatten(2, (2, 3))
    for rod in range(n):
        for cap in (0, 1):
            on = near[:, rod, cap, None, None]
            wrench[:, rod, :3, rod, cap] = unit * on
            wrench[:, rod, 3:, rod, cap] = arm[:, rod, cap].mT * on / LEVER
    return wrench.flatten(3).flatten(1, 2)


def _free(structure: Structure) -> Tensor:
    """Which unknowns may be negative, (actuated + 6 rods,) bool: forces along the ground; not tensions, nor normals."""
    along = torch.tensor([True, True, False]).repeat(2 * structure.n_rods)
    return torch.cat([torch.zeros(structure.n_actuated, dtype=torch.bool), along])

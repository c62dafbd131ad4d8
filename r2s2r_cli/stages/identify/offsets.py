"""Start states with offsets: what a training window gets wrong about where it starts, as numbers that a fit moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Structure


@dataclass(frozen=True)
class StartSpread:
    """Standard deviations of the offsets of a start state from the truth.

    position [m] and velocity [m/s] of each rod's centre of mass, per axis; tilt [rad] and tilt_rate [rad/s] across the
    rod; roll [rad] and roll_rate [rad/s] about it; rest lengths of the winched cables [m]. 0: not free.
    """

    position: float = 4e-3
    tilt: float = 0.02
    roll: float = 0.1
    velocity: float = 0.02
    tilt_rate: float = 0.1
    roll_rate: float = 0.02
    rest: float = 6e-3

    def sd(self, structure: Structure) -> np.ndarray:
        """As a vector in the order of the offsets (`displaced`), (offset,)."""
        rods = structure.n_rods
        return np.concatenate(
            [
                np.full(3 * rods, self.position), np.tile([self.tilt, self.tilt, self.roll], rods),
                np.full(3 * rods, self.velocity), np.tile([self.tilt_rate, self.tilt_rate, self.roll_rate], rods),
                np.full(structure.n_actuated, self.rest),
            ]
        )  # fmt: skip


def count(structure: Structure) -> int:
    """How many offsets a start state has."""
    return 12 * structure.n_rods + structure.n_actuated


def displaced(structure: Structure, s: Tensor, offsets: Tensor) -> Tensor:
    """Flat states s (B, NS) moved by offsets (B, offset): place, rotation in rod axes, velocity, rate, rest length."""
    import roma
    import torch

    from r2s2r_cli.engine.flat import pack_state, unpack_state

    state, rods = unpack_state(structure, s), structure.n_rods
    parts = torch.split(offsets, [3 * rods] * 4 + [structure.n_actuated], dim=-1)
    by = [part.unflatten(-1, (rods, 3)) for part in parts[:4]]
    moved = replace(
        state, p_WB=state.p_WB + by[0], q_WR=roma.quat_product(state.q_WR, roma.rotvec_to_unitquat(by[1])),
        v_WB=state.v_WB + by[2], w_R=state.w_R + by[3], rest=state.rest + parts[4],
    )  # fmt: skip
    return torch.as_tensor(pack_state(structure, moved))


def displacement(structure: Structure, s: Tensor, other: Tensor) -> Tensor:
    """The offsets (B, offset) that take flat states s (B, NS) to others (B, NS): the inverse of `displaced`."""
    import roma
    import torch

    from r2s2r_cli.engine.flat import unpack_state

    a, b = unpack_state(structure, s), unpack_state(structure, other)
    turn = roma.unitquat_to_rotvec(roma.quat_product(roma.quat_conjugation(a.q_WR), b.q_WR))
    by = (b.p_WB - a.p_WB, turn, b.v_WB - a.v_WB, b.w_R - a.w_R)
    return torch.cat([*(part.flatten(1) for part in by), b.rest - a.rest], dim=1)


def displacement_jacobian(structure: Structure, s: Tensor, offsets: Tensor) -> Tensor:
    """D displaced / d offsets, (B, NS, offset).

    A turn moves the quaternion of its own rod; every other offset is added to one number of the state.
    """
    import roma
    import torch
    from torch.func import jvp

    from r2s2r_cli.engine.flat import state_slots

    slots, rods = state_slots(structure), structure.n_rods
    found = s.new_zeros(len(s), s.shape[1], offsets.shape[1])
    starts = {"p_WB": 0, "v_WB": 6 * rods, "w_R": 9 * rods, "rest": 12 * rods}
    for name, column in starts.items():
        each = torch.arange(slots[name].size)
        found[:, slots[name].start + each, column + each] = 1.0
    turn = slots["q_WR"]
    q = s[:, turn.start : turn.start + turn.size].reshape(-1, 4).repeat(3, 1)
    by = offsets[:, 3 * rods : 6 * rods].reshape(-1, 3)
    axes = torch.eye(3, dtype=s.dtype).repeat_interleave(len(by), dim=0)
    along = jvp(lambda r: roma.quat_product(q, roma.rotvec_to_unitquat(r)), (by.repeat(3, 1),), (axes,))[1]
    along = along.reshape(3, len(s), rods, 4)
    for rod in range(rods):
        rows, columns = turn.start + 4 * rod, 3 * rods + 3 * rod
        found[:, rows : rows + 4, columns : columns + 3] = along[:, :, rod].permute(1, 2, 0)
    return found

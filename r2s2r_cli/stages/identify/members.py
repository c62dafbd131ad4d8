"""States of an ensemble as numbers that can be averaged: flat states with rotation vectors in place of quaternions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Structure

ROUNDS = 3
"""Of the mean of rotations: the error of the first is of third order in how far they scatter."""


def places(structure: Structure) -> dict[str, slice]:
    """Where each field of the state lies in the local numbers: in the order of the flat state, q_WR with 3 a rod."""
    from r2s2r_cli.engine.flat import state_slots

    found, start = {}, 0
    for name, slot in state_slots(structure).items():
        size = slot.size // 4 * 3 if name == "q_WR" else slot.size
        found[name] = slice(start, start + size)
        start += size
    return found


def deviations(structure: Structure, reference: Tensor, flat: Tensor) -> np.ndarray:
    """How flat states (E, NS) differ from the reference (NS,), (E, n): turns as rotation vectors in rod axes [rad]."""
    import roma
    import torch

    rods, q = structure.n_rods, _quaternions(structure)
    by = roma.quat_product(
        roma.quat_inverse(reference[q].view(1, rods, 4)).expand(len(flat), -1, -1), flat[:, q].reshape(-1, rods, 4)
    )
    by = torch.where(by[..., 3:] < 0, -by, by)  # the turn of less than half a revolution
    parts = [flat[:, : q.start] - reference[: q.start], roma.unitquat_to_rotvec(by).flatten(1),
             flat[:, q.stop :] - reference[q.stop :]]  # fmt: skip
    return np.asarray(torch.cat(parts, dim=1).numpy())


def placed(structure: Structure, reference: Tensor, deviation: np.ndarray) -> Tensor:
    """Flat states (E, NS) that differ from flat states (E, NS), or one (NS,), by `deviation` (E, n)."""
    import roma
    import torch

    rods, q = structure.n_rods, _quaternions(structure)
    d = torch.as_tensor(deviation)
    start = reference.expand(len(d), -1)
    turned = roma.quat_product(
        start[:, q].reshape(-1, rods, 4),
        roma.rotvec_to_unitquat(d[:, q.start : q.start + 3 * rods].reshape(-1, rods, 3)),
    )
    turned = turned / torch.linalg.vector_norm(turned, dim=-1, keepdim=True)
    parts = [start[:, : q.start] + d[:, : q.start], turned.flatten(1), start[:, q.stop :] + d[:, q.start + 3 * rods :]]
    return torch.cat(parts, dim=1)


def mean(structure: Structure, flat: Tensor) -> tuple[Tensor, np.ndarray]:
    """The mean (NS,) of flat states (E, NS), and their deviations from it (E, n), which sum to 0."""
    reference = flat[0]
    for _ in range(ROUNDS):
        reference = placed(structure, reference, deviations(structure, reference, flat).mean(axis=0)[None])[0]
    deviation = deviations(structure, reference, flat)
    return reference, deviation - deviation.mean(axis=0)


def _quaternions(structure: Structure) -> slice:
    from r2s2r_cli.engine.flat import state_slots

    slot = state_slots(structure)["q_WR"]
    return slice(slot.start, slot.start + slot.size)

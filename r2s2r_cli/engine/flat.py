"""State and Parameters as flat vectors, and the step as a function of vectors: what the tracer and the kernels see.

Numbers that the structure makes constant (a diagonal inertia's zeros, caps on the axis) are left out of the vector and
come back as constants, so that the tracer folds them away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import prod

import torch
from torch import Tensor

from r2s2r_cli.engine.parameters import Parameters, shapes, value
from r2s2r_cli.engine.state import State, state_shapes
from r2s2r_cli.engine.step import step
from r2s2r_cli.engine.structure import Structure

FlatStep = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Slot:
    """Where a field lies in the vector: `size` numbers from `start`; `kept`: their places in the flattened field."""

    start: int
    size: int
    shape: tuple[int, ...]
    kept: tuple[int, ...]


@lru_cache(maxsize=256)
def parameter_slots(structure: Structure) -> dict[str, Slot]:
    """Every parameter field's place in the flat parameter vector; fields the structure does not read have size 0."""
    unread = {
        "stiffness2": structure.cubic, "stiffness3": structure.cubic, "tendon_stiffness": structure.tendons,
        "tendon_rest": structure.tendons, "lag": structure.lag, "droop": structure.droop,
        "rod_radius": bool(structure.rod_pairs), "rod_friction": bool(structure.rod_pairs),
    }  # fmt: skip
    slots, start = {}, 0
    for name, shape in shapes(structure).items():
        kept: Sequence[int] = range(prod(shape)) if unread.get(name, True) else ()
        if structure.axial and name == "inertia":
            # A body of revolution: transverse and axial moment, the first standing for both transverse axes.
            kept = [9 * rod + k for rod in range(shape[0]) for k in (0, 8)]
        elif structure.axial and name == "p_BE":
            kept = range(2, prod(shape), 3)
        slots[name] = Slot(start, len(kept), shape, tuple(kept))
        start += len(kept)
    return slots


@lru_cache(maxsize=256)
def state_slots(structure: Structure) -> dict[str, Slot]:
    """Every state field's place in the flat state vector."""
    slots, start = {}, 0
    for name, shape in state_shapes(structure).items():
        n = prod(shape)
        slots[name] = Slot(start, n, shape, tuple(range(n)))
        start += n
    return slots


def size(slots: dict[str, Slot]) -> int:
    """Length of the vector."""
    return sum(slot.size for slot in slots.values())


def pack_parameters(structure: Structure, theta: Parameters) -> Tensor:
    """Flat parameter vector (B, NP); differentiable. Fields of batch 1 are repeated."""
    slots = parameter_slots(structure)
    tensors = {name: value(theta, name) for name in slots}
    batch = max(tensor.shape[0] for tensor in tensors.values())
    parts = []
    for name, slot in slots.items():
        if slot.size:
            flat = tensors[name].flatten(1)
            part = flat if slot.size == flat.shape[1] else flat[:, list(slot.kept)]
            parts.append(part.expand(batch, -1))
    return torch.cat(parts, dim=1)


def unpack_parameters(structure: Structure, p: Tensor) -> Parameters:
    """Parameters from the flat vector. Fields that the structure does not read are zero."""
    named: dict[str, Tensor] = {}
    extra: dict[str, Tensor] = {}
    for name, slot in parameter_slots(structure).items():
        part = p[:, slot.start : slot.start + slot.size]
        if slot.size == prod(slot.shape):
            tensor = part.reshape(len(p), *slot.shape)
        elif name == "inertia":
            transverse, axial = part.reshape(len(p), slot.shape[0], 2).unbind(-1)
            tensor = torch.diag_embed(torch.stack([transverse, transverse, axial], dim=-1))
        elif name == "p_BE":
            z = part.reshape(len(p), *slot.shape[:-1])
            tensor = torch.stack([torch.zeros_like(z), torch.zeros_like(z), z], dim=-1)
        else:
            tensor = p.new_zeros((p.shape[0], *slot.shape))
        (extra if "." in name else named)[name] = tensor
    return Parameters(**named, extra=extra)


def pack_state(structure: Structure, state: State, *, leading: int = 1) -> Tensor:
    """Flat state vector (B, NS); differentiable. leading: axes before those of a field, 2 for frames (B, F, NS)."""
    names = state_slots(structure)
    parts = [(state.extra[name] if "." in name else getattr(state, name)).flatten(leading) for name in names]
    return torch.cat(parts, dim=leading)


def unpack_state(structure: Structure, s: Tensor) -> State:
    """State from the flat vector (..., NS); leading axes stay."""
    named: dict[str, Tensor] = {}
    extra: dict[str, Tensor] = {}
    for name, slot in state_slots(structure).items():
        part = s[..., slot.start : slot.start + slot.size].reshape(*s.shape[:-1], *slot.shape)
        (extra if "." in name else named)[name] = part
    return State(**named, extra=extra)


def flat_step(structure: Structure) -> FlatStep:
    """The step of `structure` as a function of vectors: (s (B, NS), u (B, A), p (B, NP), h (B, 1)) -> s' (B, NS)."""

    def function(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        theta = unpack_parameters(structure, p)
        return pack_state(structure, step(structure, theta, unpack_state(structure, s), u, h))

    return function


def twins(structure: Structure) -> tuple[tuple[tuple[str, int], ...], ...]:
    """Groups of places in the vectors that hold the same quantity of equal parts: of rods, of cables, of winches.

    In kinds "s" (state), "a" (its adjoint), "u" (commands) and "p" (parameters). Machine code for one environment
    computes the members of a group side by side.
    """
    groups: list[tuple[tuple[str, int], ...]] = []
    fields = [("s", slot) for slot in state_slots(structure).values()]
    fields += [("a", slot) for slot in state_slots(structure).values()]
    fields += [("p", slot) for slot in parameter_slots(structure).values()]
    for kind, slot in fields:
        parts = slot.shape[0]
        if slot.size == 0 or slot.size % parts:
            continue
        each = slot.size // parts
        for index in range(each):
            places = [(kind, slot.start + part * each + index) for part in range(parts)]
            groups += _chunks(places)
    groups += _chunks([("u", k) for k in range(structure.n_actuated)])
    return tuple(groups)


def _chunks(places: list[tuple[str, int]]) -> list[tuple[tuple[str, int], ...]]:
    """Threes or fours, what is left over alone: 9 are 3 threes, 6 are 2 threes, 4 are one four."""
    width = 3 if len(places) % 3 == 0 else 4
    whole = [tuple(places[k : k + width]) for k in range(0, len(places), width)]
    return [group for group in whole if len(group) > 1]

"""End caps as the camera sees them at many frames, from flat states, and their exact derivatives.

All frames go through torch together, and the directions of a derivative lie side by side in the batch: the same numbers
as frame by frame, with a hundredth of the calls.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Structure

POSE = ("p_WB", "q_WR")
"""The fields of the state that end caps are read off."""


def caps_in_view(structure: Structure, p: Tensor, states: Tensor) -> Tensor:
    """End caps (F, cap, 3) [m] at states (F, NS) with parameters p, (NP,) for all or (F, NP)."""
    import torch

    from r2s2r_cli.engine import end_caps, observe
    from r2s2r_cli.engine.flat import unpack_parameters, unpack_state
    from r2s2r_cli.engine.hooks import effective

    theta = effective(structure, unpack_parameters(structure, p if p.ndim == 2 else p[None]))
    caps = end_caps(theta, unpack_state(structure, states))
    now = torch.zeros(1, dtype=states.dtype)  # what depends on time is no number of the engine (Mapping.delays)
    return observe(structure, theta, now, caps[:, None])[:, 0]


def caps_by_state(structure: Structure, p: Tensor, states: Tensor) -> Tensor:
    """Their derivatives by the states, (F, cap, 3, NS)."""
    import torch
    from torch.func import jvp

    from r2s2r_cli.engine.flat import state_slots

    frames, size = states.shape
    slots = [state_slots(structure)[name] for name in POSE]
    read = [k for slot in slots for k in range(slot.start, slot.start + slot.size)]
    axes = torch.eye(size, dtype=states.dtype)[read].repeat_interleave(frames, dim=0)
    along = jvp(lambda s: caps_in_view(structure, p, s), (states.repeat(len(read), 1),), (axes,))[1]
    along = along.unflatten(0, (len(read), frames))
    found = states.new_zeros(*along.shape[1:], size)
    found[..., read] = along.movedim(0, -1)
    return found


def caps_by_parameters(structure: Structure, p: Tensor, d_p: Tensor, states: Tensor) -> Tensor:
    """Their derivatives along d_p (NP, D) at the same states, (F, cap, 3, D): where caps lie on their rods, and what
    effects make of rods and cameras. Forces act on the states alone."""
    import torch
    from torch.func import jvp

    from r2s2r_cli.engine.flat import parameter_slots
    from r2s2r_cli.engine.hooks import overrides

    (n, frames), caps = (d_p.shape[1], len(states)), 2 * structure.n_rods
    slot = parameter_slots(structure)["p_BE"]
    changed = overrides(structure, "parameters") or overrides(structure, "observation")
    if not n or not (changed or bool(d_p[slot.start : slot.start + slot.size].any())):
        return states.new_zeros(frames, caps, 3, n)

    def seen(p: Tensor) -> Tensor:
        return caps_in_view(structure, p.repeat_interleave(frames, dim=0), states.repeat(n, 1))

    along = jvp(seen, (p.expand(n, -1).clone(),), (d_p.T.contiguous(),))[1]
    return torch.as_tensor(along.unflatten(0, (n, frames)).movedim(0, -1))

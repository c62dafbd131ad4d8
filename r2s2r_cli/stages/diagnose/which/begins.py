"""Where pieces begin and end: by each hypothesis's own camera, and with what no cap shows of the piece before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from r2s2r_cli.stages.diagnose.which.stretches import Stretch

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, Structure

TINY = 1e-6
MOVED_M = 1e-7
"""A camera that shows the robot so near to where it is changes no start."""


def acting(structure: Structure, theta: Parameters, hook: str) -> Tensor:
    """Rows (k,) of the parameters in which an effect with this hook has a number that is not its off value."""
    import torch

    from r2s2r_cli.engine.hooks import overrides

    found = torch.zeros(len(theta.mass), dtype=torch.bool)
    for effect in overrides(structure, hook):
        off = effect.off(structure)
        for name, x in theta.of(effect.name).items():
            found |= (x != off[name]).any(dim=1)
    return found


def rows_of(theta: Parameters, rows: Tensor) -> Parameters:
    """Some rows of a batch of parameters; those of batch 1 as they are."""
    return theta.map(lambda x: x[rows] if len(x) > 1 else x)


def placed(structure: Structure, theta: Parameters, whose: Tensor, start: Tensor, up: float) -> Tensor:
    """Starts (row, NS) where each hypothesis's camera says that the robot is: they stand where it was
    seen. theta: parameters of the hypotheses, batch k; whose (row,): which one's a start is; up: height of the ground
    in the world [m]."""
    import roma
    import torch

    from r2s2r_cli.engine import end_caps
    from r2s2r_cli.engine.flat import pack_state, unpack_state
    from r2s2r_cli.engine.hooks import effective
    from r2s2r_cli.engine.late import unseen
    from r2s2r_cli.engine.roll import along
    from r2s2r_cli.engine.settle import lowered

    rows = acting(structure, theta, "observation")[whose].nonzero()[:, 0]
    if not len(rows):
        return start
    with torch.no_grad():
        own, state = rows_of(theta, whose[rows]), unpack_state(structure, start[rows])
        robot = effective(structure, own)
        shown = end_caps(robot, state)
        lift = torch.tensor([0.0, 0.0, up], dtype=start.dtype)
        real = unseen(structure, own, shown + lift) - lift
        by = (real - shown).unflatten(1, (-1, 2)).mean(dim=2)
        turned = roma.rotmat_to_unitquat(along(real, roma.unitquat_to_rotmat(state.q_WR)))
        moved = lowered(robot, replace(state, p_WB=state.p_WB + by, q_WR=turned), only_up=True)
        far = (real - shown).abs().amax(dim=(1, 2)) > MOVED_M
        found = start.clone()
        found[rows] = torch.where(far[:, None], pack_state(structure, moved), start[rows])
        return found


def carried(
    structure: Structure, many: Sequence[Stretch], start: Tensor, before: Tensor, let_out: Tensor | float = 0.0
) -> Tensor:  # fmt: skip
    """Starts (k, stretch, NS) with what no cap shows from the states before, of the same shape: rest lengths of cables
    that hang, by each hypothesis's own account, winding rates, the memory of effects. What left the finite numbers
    hands nothing on. let_out: what the starts have more of winched cables [m], (k, stretch, actuated)."""
    import torch

    from r2s2r_cli.engine.flat import state_slots

    slots = state_slots(structure)
    own = torch.zeros(start.shape[-1], dtype=torch.bool)
    for name, slot in slots.items():
        own[slot.start : slot.start + slot.size] = name == "winding" or "." in name
    found = torch.where(own, before, start)
    rest = slice(slots["rest"].start, slots["rest"].start + slots["rest"].size)
    for i, one in enumerate(many):
        if one.taut is not None:
            more = let_out if isinstance(let_out, float) else let_out[:, i]
            taut, hangs = torch.as_tensor(one.taut) + more, before[:, i, rest]
            found[:, i, rest] = torch.where(hangs > taut + one.margin, hangs, taut)
    return torch.where(before.isfinite().all(dim=-1, keepdim=True), found, start)


def between(stored: Tensor, place: Tensor) -> Tensor:
    """Values (k, F, ...) at places (k, F) among those stored (k, stored, ...), on straight lines between them; beyond
    the ends those of the ends."""
    import torch

    low = (place + TINY).floor().long().clamp(0, stored.shape[1] - 2)
    share = (place - low).clamp(0.0, 1.0).reshape(*place.shape, *[1] * (stored.ndim - 2))
    row = torch.arange(len(stored))[:, None]
    return stored[row, low] * (1 - share) + stored[row, low + 1] * share

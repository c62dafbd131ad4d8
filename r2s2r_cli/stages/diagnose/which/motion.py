"""Which hypotheses move the robot alike, so that it is simulated once for all of them.

A sensor that reads wrong moves nothing while recorded commands are replayed; and a third of what is tried is that.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Structure

SEEN = ("sensing", "observation")
"""Hooks that act on what is seen of a trajectory."""


@lru_cache(maxsize=16)
def moves_nothing(structure: Structure) -> tuple[str, ...]:
    """Fields of the parameters, `EFFECT.NAME`, that no replayed trajectory depends on."""
    from r2s2r_cli.engine.hooks import Hooks

    hooks = [
        name for name, one in vars(Hooks).items()
        if callable(one) and not name.startswith("_") and name not in (*SEEN, "sizes", "off")
    ]  # fmt: skip
    return tuple(
        f"{effect.name}.{name}"
        for effect in structure.effects
        if all(getattr(type(effect), hook) is getattr(Hooks, hook) for hook in hooks)
        for name in effect.sizes(structure)
    )


def first_of_each(
    structure: Structure, packed: Tensor, s0: Tensor, delays: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places of the first hypothesis of each motion, and the place of every hypothesis among these, (k,).

    packed (k, NP): flat parameters; s0: starts (k stretch, NS), those of a hypothesis after each other; delays (k,)
    [s]: of its commands. Alike is alike in every bit.
    """
    import torch

    from r2s2r_cli.engine.flat import parameter_slots

    k, slots = len(delays), parameter_slots(structure)
    moving = packed.clone()
    for name in moves_nothing(structure):
        moving[:, slots[name].start : slots[name].start + slots[name].size] = 0.0
    rows = torch.cat([moving, s0.reshape(k, -1), torch.as_tensor(delays)[:, None]], dim=1).numpy()
    first: dict[bytes, int] = {}
    back = np.array([first.setdefault(row.tobytes(), len(first)) for row in rows])
    return np.unique(back, return_index=True)[1], back

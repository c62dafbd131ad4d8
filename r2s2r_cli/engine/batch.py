"""Batches: all tensors of a rollout have one batch size, or 1, and one dtype and device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING

from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError

if TYPE_CHECKING:
    from r2s2r_cli.engine.parameters import Parameters
    from r2s2r_cli.engine.state import State


def tensors_of(x: State | Parameters) -> dict[str, Tensor]:
    """All tensors of a state or of parameters, those of effects included, by name."""
    own = {f.name: getattr(x, f.name) for f in fields(x) if f.name != "extra"}
    return {**own, **x.extra}


def common_batch(tensors: Mapping[str, Tensor]) -> int:
    """The one batch of all tensors, those of batch 1 being shared. Raises EngineInputError, naming the odd one, where
    batches, dtypes or devices differ."""
    first, reference = next(iter(tensors.items()))
    batch, owner = 1, first
    for name, tensor in tensors.items():
        if (tensor.dtype, tensor.device) != (reference.dtype, reference.device):
            raise EngineInputError(
                name, "another dtype or device", expected=f"{reference.dtype} on {reference.device}, as {first}",
                received=f"{tensor.dtype} on {tensor.device}",
            )  # fmt: skip
        if len(tensor) not in (1, batch):
            if batch > 1 or len(tensor) == 0:
                raise EngineInputError(
                    name, "another batch", expected=f"{batch}, as {owner}, or 1" if batch > 1 else "at least 1",
                    received=str(len(tensor)),
                )  # fmt: skip
            batch, owner = len(tensor), name
    return batch

"""Guarded calls (eager form; the tracer's form follows)."""

from __future__ import annotations
from collections.abc import Callable
import torch
from torch import Tensor


def guarded(
    when: Tensor, fn: Callable[..., tuple[Tensor, ...]], inputs: tuple[Tensor, ...], otherwise: tuple[Tensor, ...]
) -> tuple[Tensor, ...]:
    """fn(*inputs) where `when`, else `otherwise`."""
    if not bool(when.any()):
        return otherwise
    return tuple(
        torch.where(when.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in zip(fn(*inputs), otherwise, strict=True)
    )

"""Arrays as kernels hold them: (block, ..., lane), a lane an environment; the last block is filled up by repetition."""

from __future__ import annotations

import torch
from torch import Tensor


def to_lanes(x: Tensor, lanes: int) -> Tensor:
    """(B, ..., n) as (block, ..., n, lane), contiguous. With one lane: (B, ..., n, 1)."""
    batch = x.shape[0]
    blocks = -(-batch // lanes)
    if blocks * lanes != batch:
        x = torch.cat([x, x[-1:].expand(blocks * lanes - batch, *x.shape[1:])])
    # A copy even where the order is the same already: kernels write into it.
    return x.reshape(blocks, lanes, *x.shape[1:]).movedim(1, -1).clone(memory_format=torch.contiguous_format)


def from_lanes(x: Tensor, batch: int) -> Tensor:
    """(block, ..., lane) as (B, ...), without the repetitions."""
    return x.movedim(-1, 1).flatten(0, 1)[:batch]


def address(x: Tensor, *index: int) -> int:
    """Address of an element of a contiguous array."""
    offset = sum(i * stride for i, stride in zip(index, x.stride(), strict=False))
    return x.data_ptr() + offset * x.element_size()


def places(x: Tensor) -> tuple[int, int]:
    """Address of the first block of a contiguous array, and how many bytes each is behind the one before."""
    return x.data_ptr(), x.stride(0) * x.element_size()

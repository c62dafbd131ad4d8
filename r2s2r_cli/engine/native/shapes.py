"""Shapes and types of what a rollout is given."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError


@dataclass(frozen=True)
class Sizes:
    """Lengths of the state, input and parameter vectors."""

    n_state: int
    n_input: int
    n_param: int

    def tangents(
        self, s0: Tensor, u: Tensor, ds0: Tensor | None, du: Tensor | None, dp: Tensor | None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """The three tangents with batch B, zeros for None: (B, NS, D), (B, K, NU, D), (B, NP, D)."""
        given = [x for x in (ds0, du, dp) if x is not None]
        directions = given[0].shape[-1] if given else 0
        if not directions:
            raise EngineInputError("ds0, du, dp", "no direction is given", expected="a tangent", received="none")
        shapes = {"ds0": s0.shape, "du": u.shape, "dp": (len(s0), self.n_param)}
        result = []
        for (name, shape), x in zip(shapes.items(), (ds0, du, dp), strict=True):
            whole = (*shape, directions)
            if x is None:
                result.append(s0.new_zeros(whole))
                continue
            _check(name, x, whole)
            result.append(x.detach().to(s0.dtype).expand(whole))
        return result[0], result[1], result[2]

    def adjoints(self, s0: Tensor, g_frames: Tensor, frames: int) -> Tensor:
        """The adjoints of all frames (B, F, NS), of the type of s0; kernels read them by address, whatever is there."""
        whole = (s0.shape[0], frames, self.n_state)
        _check("g_frames", g_frames, whole)
        return g_frames.to(s0.dtype).expand(whole)


def checked(
    sizes: Sizes, s0: Tensor, u: Tensor, p: Tensor, h: float, hold: int, every: int
) -> tuple[Tensor, Tensor, Tensor]:
    """s0, u and p with equal batch and type. Raises EngineInputError."""
    if s0.dtype not in (torch.float64, torch.float32):
        raise EngineInputError("s0", "wrong type", expected="float64 or float32", received=str(s0.dtype))
    for name, value in (("hold", hold), ("every", every)):
        if value < 1:
            raise EngineInputError(name, "not positive", expected="1 or more", received=str(value))
    if not 0 < h < math.inf:
        raise EngineInputError("h", "no time of a step", expected="a time above 0 s, and a finite one", received=f"{h}")
    batch = s0.shape[0] if s0.ndim else 0
    rows = u.shape[1] if u.ndim > 1 else 0
    whole = {"s0": (batch, sizes.n_state), "u": (batch, rows, sizes.n_input), "p": (batch, sizes.n_param)}
    for (name, shape), x in zip(whole.items(), (s0, u, p), strict=True):
        _check(name, x, shape)
    return s0, u.to(s0.dtype).expand(whole["u"]), p.to(s0.dtype).expand(whole["p"])


def _check(name: str, x: Tensor, shape: tuple[int, ...]) -> None:
    """Raise EngineInputError unless x has this shape, or it with batch 1."""
    if tuple(x.shape[1:]) != tuple(shape[1:]) or not x.ndim or x.shape[0] not in (1, shape[0]):
        raise EngineInputError(name, "wrong shape", expected=str(tuple(shape)), received=str(tuple(x.shape)))

"""Small symmetric systems, solved without a branch so that they can be traced."""

from __future__ import annotations

import torch
from torch import Tensor


def ldl_solve(lower: Tensor, diagonal: Tensor, rhs: Tensor) -> Tensor:
    """Solve A x = rhs for positive definite A, by LDL^T without pivoting.

    lower: (..., n, n), read strictly below the diagonal; diagonal, rhs: (..., n). Returns (..., n).
    Entry by entry on purpose: the tracer makes straight-line code of it, and its order of operations is the same in
    torch and in machine code.
    """
    n = rhs.shape[-1]
    scaled: list[list[Tensor]] = [[] for _ in range(n)]  # rows of L D
    unit: list[list[Tensor]] = [[] for _ in range(n)]  # rows of L
    inverse: list[Tensor] = []
    for j in range(n):
        pivot = diagonal[..., j]
        for k in range(j):
            pivot = pivot - unit[j][k] * scaled[j][k]
        inverse.append(1.0 / pivot)
        for i in range(j + 1, n):
            entry = lower[..., i, j]
            for k in range(j):
                entry = entry - scaled[i][k] * unit[j][k]
            scaled[i].append(entry)
            unit[i].append(entry * inverse[j])
    y: list[Tensor] = []
    for i in range(n):
        entry = rhs[..., i]
        for k in range(i):
            entry = entry - unit[i][k] * y[k]
        y.append(entry)
    x = [y[i] * inverse[i] for i in range(n)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = x[i] - unit[k][i] * x[k]
    return torch.stack(x, dim=-1)

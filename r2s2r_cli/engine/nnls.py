"""Regularised least squares with unknowns that may not be negative: active sets, a batch of problems at once."""

from __future__ import annotations

import torch
from torch import Tensor

NEGATIVE = 100.0
"""A gradient below zero by less than this many roundings of the largest one is zero."""
PIVOTS = 10
"""Exchanges a row may make, per unknown. Random problems make less than 2; only roundings could make so many."""


def nnls(matrix: Tensor, load: Tensor, *, free: Tensor, shrink: float) -> Tensor:
    """Minimum over x of |load + matrix x|^2 + shrink |x|^2 with x at least 0 where not free.

    matrix: (B, m, n); load: (B, m); free: unknowns of any sign, (n,) bool; shrink > 0: makes the minimum one point.
    Returns x (B, n), to rounding; NaN in, NaN out. No derivative. The method is Lawson and Hanson, Solving Least
    Squares Problems (1974), chapter 23, algorithm NNLS: the unknowns with the steepest descent enter one by one, those
    that come to zero leave. Its linear systems are kept solved, by principal pivots on the normal equations: these are
    products and sums entry by entry, so a row has the same bits in any batch. Matrix products and LAPACK's have not.
    """
    batch, n = len(matrix), matrix.shape[-1]
    normal = (shrink * torch.eye(n, dtype=matrix.dtype, device=matrix.device)).expand(batch, n, n)
    pull = torch.zeros_like(matrix[:, 0])
    for k in range(matrix.shape[1]):
        normal = normal + matrix[:, k, :, None] * matrix[:, k, None]
        pull = pull + matrix[:, k] * load[:, k, None]
    tableau = torch.cat([normal, pull[..., None]], dim=-1)
    for i in torch.nonzero(free)[:, 0]:
        tableau = _pivoted(tableau, i.expand(batch))
    inside = free.expand(batch, n)
    x = torch.where(inside, tableau[..., -1], 0.0)
    slight = NEGATIVE * torch.finfo(matrix.dtype).eps * pull.abs().amax(dim=-1)
    for _ in range(PIVOTS * n):
        # The last column holds the minimum over the unknowns inside, and the gradient there along those outside.
        goal = tableau[..., -1]
        crossing = inside & ~free & (goal < 0)
        share, first = torch.where(crossing, x / (x - goal), torch.inf).min(dim=-1)
        lowest, steepest = torch.where(inside, torch.inf, goal).min(dim=-1)
        leaves = crossing.any(dim=-1)
        x = torch.where(inside, torch.where(leaves[:, None], x + share[:, None] * (goal - x), goal), 0.0)
        moves = leaves | (lowest < -slight)
        if not bool(moves.any()):
            break
        at = torch.where(leaves, first, steepest)
        tableau = torch.where(moves[:, None, None], _pivoted(tableau, at), tableau)
        here = torch.arange(n, device=at.device) == at[:, None]
        inside = inside ^ (here & moves[:, None])
        x = torch.where(here & leaves[:, None], 0.0, x)
    return _refined(x, normal, pull, tableau, inside, free)


def _pivoted(tableau: Tensor, at: Tensor) -> Tensor:
    """The equations w = M x + c, (B, n, n + 1), with x and w exchanged in line at, (B,): x there as w and the others
    say. M's diagonal stays above 0, as that of a positive definite matrix does."""
    where = at[:, None, None]
    row = tableau.gather(1, where.expand(-1, 1, tableau.shape[2]))
    column = tableau.gather(2, where.expand(-1, tableau.shape[1], 1))
    pivot = row.gather(2, where)
    line, slope = row / pivot, column / pivot
    rest = tableau - column * line
    rest = rest.scatter(1, where.expand_as(row), -line)
    return rest.scatter(2, where.expand_as(column), slope.scatter(1, where, 1.0 / pivot))


def _refined(x: Tensor, normal: Tensor, pull: Tensor, tableau: Tensor, inside: Tensor, free: Tensor) -> Tensor:
    """One step of iterative refinement: what roundings of many pivots left of the gradient is taken back."""
    gradient = torch.where(inside, pull + (normal * x[..., None]).sum(1), 0.0)
    x = x - torch.where(inside, (tableau[..., :-1] * gradient[:, None]).sum(-1), 0.0)
    return torch.where(free, x, torch.relu(x))

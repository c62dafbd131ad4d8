"""Every operation that can be traced, against torch: value and derivatives in both modes, singular points too."""

# ruff: noqa: E501 (a table of cases, one a line)

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.native import NativeStep, eager
from r2s2r_cli.engine.native.operators import OPERATORS

Fn = Callable[[Tensor], Tensor]
INF = float("inf")


@dataclass(frozen=True)
class Case:
    """fn: (B, n) -> (B, ...). points: rows of arguments. aten: the operations that it is there to show."""

    fn: Fn
    points: list[list[float]]
    aten: tuple[str, ...]


PLAIN = [[-1.7, 0.3, 2.0], [0.4, -0.2, 0.9], [1.1, 2.3, -0.6]]
"""Nothing special about them."""
ZERO = [[0.0, 0.0, 0.0], [0.0, 1.0, -1.0], [2.0, 0.0, 0.0]]
TIES = [[1.0, 1.0, 1.0], [0.5, 0.5, -0.5], [2.0, -1.0, 2.0]]
POSITIVE = [[0.2, 1.0, 3.0], [0.7, 0.1, 5.0]]
INSIDE = [[-0.9, 0.0, 0.4], [0.99, -0.1, 0.3]]
MASK = torch.tensor([True, False, True])
INDEX = torch.tensor([2, 0, 0, 1])


def written(x: Tensor) -> Tensor:
    """New tensors and views written in place."""
    y = torch.zeros(len(x), 3, dtype=x.dtype)
    y[:, 0] = x[:, 1] * 2
    y[:, 1:] += x[:, :2]
    z = torch.zeros_like(x)
    z.copy_(y)
    z[:, 2].mul_(x[:, 2])
    w = x.new_ones(len(x), 3)
    w[:, 0].fill_(3.0)
    w.view(-1)[1] *= 2.0
    return z + w + x.clone().zero_()


def matrices(x: Tensor) -> tuple[Tensor, Tensor]:
    """Two matrices (B, 2, 2) of a row of 3 numbers."""
    return x[:, [0, 1, 2, 0]].reshape(-1, 2, 2), x[:, [1, 1, 0, 2]].reshape(-1, 2, 2)


CASES: dict[str, Case] = {
    **{
        name: Case(fn, points, (name,))
        for name, fn, points in [
            ("sin", torch.sin, PLAIN), ("cos", torch.cos, PLAIN), ("tan", torch.tan, PLAIN), ("exp", torch.exp, PLAIN),
            ("tanh", torch.tanh, PLAIN), ("sinh", torch.sinh, PLAIN), ("cosh", torch.cosh, PLAIN),
            ("atan", torch.atan, PLAIN), ("expm1", torch.expm1, PLAIN), ("neg", torch.neg, PLAIN),
            ("square", torch.square, PLAIN + ZERO), ("exp2", torch.exp2, PLAIN), ("frac", torch.frac, PLAIN),
            ("asin", torch.asin, [*INSIDE, [1.0, -1.0, 0.0]]), ("acos", torch.acos, [*INSIDE, [1.0, -1.0, 0.0]]),
            ("log", torch.log, [*POSITIVE, [0.0, 1.0, 1.0]]), ("log1p", torch.log1p, POSITIVE + ZERO[:1]),
            ("log2", torch.log2, POSITIVE), ("log10", torch.log10, POSITIVE),
            ("sqrt", torch.sqrt, [*POSITIVE, [0.0, 1.0, 4.0]]), ("rsqrt", torch.rsqrt, POSITIVE),
            ("reciprocal", torch.reciprocal, PLAIN), ("abs", torch.abs, PLAIN + ZERO),
            ("sign", torch.sign, PLAIN + ZERO), ("sgn", torch.sgn, PLAIN + ZERO),
            ("relu", torch.relu, PLAIN + ZERO), ("sigmoid", torch.sigmoid, [*PLAIN, [0.0, 800.0, -800.0]]),
            ("floor", torch.floor, PLAIN), ("ceil", torch.ceil, PLAIN), ("trunc", torch.trunc, PLAIN),
            ("round", torch.round, [*PLAIN, [0.5, 1.5, -2.5]]), ("deg2rad", torch.deg2rad, PLAIN),
            ("detach", lambda x: x * x.detach(), PLAIN), ("cumsum", lambda x: torch.cumsum(x, 1), PLAIN),
            ("logical_not", lambda x: torch.where(torch.logical_not(x > 0), x, 2 * x), PLAIN + ZERO),
            ("isnan", lambda x: torch.where(torch.isnan(x), 0.0, x), [*PLAIN, [float("nan"), 1.0, 2.0]]),
            ("isinf", lambda x: torch.where(torch.isinf(x), 0.0, x), [*PLAIN, [INF, 1.0, -INF]]),
            ("isfinite", lambda x: torch.where(torch.isfinite(x), x, 0.0), [*PLAIN, [INF, 1.0, float("nan")]]),
        ]
    },
    "add": Case(lambda x: torch.add(x[:, :1], x, alpha=2.5) + 1.0 + (x > 0), PLAIN, ("add",)),
    "sub": Case(lambda x: torch.sub(x[:, :1], x, alpha=2.5) - 1.0, PLAIN, ("sub",)),
    "round, decimals": Case(lambda x: torch.round(x, decimals=1) + torch.round(8 * x, decimals=-1) * x, PLAIN, ("round",)),
    "truth values": Case(
        lambda x: x * ((x > 0) + (x > -1)) + x * ~((x > 0) * (x > 1)) + x * (x > 0).prod(1, keepdim=True)
        + x * torch.cumsum(x > 0, 1) + x * (x > -1).sum(1, keepdim=True),
        PLAIN + ZERO, ("add", "mul", "prod", "cumsum", "sum"),
    ),
    "rsub": Case(lambda x: 1.0 - x, PLAIN, ("rsub",)),
    "mul": Case(lambda x: x * x[:, 1:2] * -3.0 * (x > 0), PLAIN + ZERO, ("mul",)),
    "div": Case(lambda x: x / x[:, 1:2] / 3.0 - x[:, 1:2] / -x, PLAIN, ("div",)),
    "div, rounded": Case(lambda x: torch.div(x, 0.7, rounding_mode="floor") * x, PLAIN, ("div",)),
    "pow, whole": Case(lambda x: x**3 + x**-2 + x**7 + x**0 + x**1, PLAIN, ("pow",)),
    "pow, at 0": Case(lambda x: x**2 + x**1 + x**0, ZERO, ("pow",)),
    "pow, half": Case(lambda x: x**0.5 + x**1.5 + x**-0.5, POSITIVE, ("pow",)),
    "pow, half, at 0": Case(lambda x: x**1.5 + torch.relu(x) ** 2.5, [*ZERO[::2], [0.0, -0.0, 4.0]], ("pow",)),
    "pow, other": Case(lambda x: x**2.3 + 1.7**x, POSITIVE, ("pow",)),
    "pow, both": Case(lambda x: x[:, :2] ** x[:, 1:], [[0.5, 2.0, 1.3], [2.0, -1.0, 0.0], [0.0, 2.0, 3.0]], ("pow",)),
    "atan2": Case(lambda x: torch.atan2(x[:, :2], x[:, 1:]), [*PLAIN, [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], ("atan2",)),
    "hypot": Case(lambda x: torch.hypot(x[:, :2], x[:, 1:]), PLAIN, ("hypot",)),
    "maximum": Case(lambda x: torch.maximum(x[:, :2], x[:, 1:]), PLAIN + TIES, ("maximum",)),
    "minimum": Case(lambda x: torch.minimum(x[:, :2], x[:, 1:]), PLAIN + TIES, ("minimum",)),
    "clamp": Case(lambda x: torch.clamp(x, -0.5, 1.0), PLAIN + TIES, ("clamp",)),
    "clamp_min": Case(lambda x: x.clamp_min(0.5) + torch.clamp(x, min=-0.5), PLAIN + TIES, ("clamp_min",)),
    "clamp_max": Case(lambda x: x.clamp_max(0.5) + torch.clamp(x, max=-0.5), PLAIN + TIES, ("clamp_max",)),
    "clamp, tensors": Case(lambda x: torch.clamp(x[:, 0], x[:, 1], x[:, 2])[:, None], PLAIN + TIES + ZERO, ("clamp",)),
    "where": Case(lambda x: torch.where(x > 0, x.square(), torch.where(x < -1, 0.0, x)), PLAIN + ZERO, ("where", "gt", "lt")),
    "where, dead sides": Case(lambda x: torch.where(x > 0, torch.where(x > 0, x, 1.0).sqrt(), 0.0), PLAIN + ZERO, ("where",)),
    "masked_fill": Case(lambda x: x.masked_fill(x > 0, 3.0).masked_fill(MASK, -1.0), PLAIN, ("masked_fill",)),
    "comparisons": Case(
        lambda x: torch.stack([(x >= x[:, :1]) * x, (x <= 0.3) * x, (x == x[:, :1]) * x, (x != 1.0) * x], 1),
        PLAIN + TIES, ("ge", "le", "eq", "ne"),
    ),
    "logic": Case(
        lambda x: x * ((x > 0) & (x < 1) | (x > 1.5)) + x * ((x > 0) ^ (x < 0.5)) + x * ~(x > 0)
        + x * torch.logical_and(x > 0, x) + x * torch.logical_or(x > 0, x < -1) + x * torch.logical_xor(x > 0, x > 1),
        PLAIN + ZERO,
        ("bitwise_and", "bitwise_or", "bitwise_xor", "bitwise_not", "logical_and", "logical_or", "logical_xor"),
    ),
    "any, all": Case(lambda x: x * (x > 0).any(1, keepdim=True) - x * (x > -1).all(1, keepdim=True), PLAIN, ("any", "all")),
    "lerp": Case(lambda x: torch.lerp(x, x[:, :1], 0.3) + torch.lerp(x, x[:, :1], x), PLAIN, ("lerp",)),
    "addcmul": Case(lambda x: torch.addcmul(x, x, x[:, :1], value=0.5), PLAIN, ("addcmul",)),
    "sum": Case(lambda x: torch.stack([x.sum(), x.sum(1)[0], x.sum((0, 1), keepdim=True)[0, 0]])[None], PLAIN[:1], ("sum",)),
    "mean": Case(lambda x: x.mean(1, keepdim=True) + x, PLAIN, ("mean",)),
    "prod": Case(lambda x: x.prod(1, keepdim=True), PLAIN, ("prod",)),
    "amax": Case(lambda x: x.amax(1, keepdim=True), PLAIN + TIES, ("amax",)),
    "amin": Case(lambda x: x.amin(1), PLAIN + TIES, ("amin",)),
    "amax, amin, beside infinity": Case(
        lambda x: x.masked_fill(x < 0, -INF).amax(1, keepdim=True) + torch.where(x < 0, INF, x).amin(1, keepdim=True) * x,
        [*PLAIN, [float("nan"), 1.0, 2.0]], ("amax", "amin"),
    ),
    "vector_norm": Case(
        lambda x: torch.linalg.vector_norm(x, dim=1, keepdim=True) * x + torch.linalg.vector_norm(x, ord=1, dim=1)[:, None],
        PLAIN + ZERO, ("linalg_vector_norm",),
    ),
    "cross": Case(lambda x: torch.linalg.cross(x, x.square()) + torch.cross(x, x[:, [1, 0, 2]], dim=-1), PLAIN, ("linalg_cross",)),
    "matmul": Case(lambda x: matrices(x)[0] @ matrices(x)[1], PLAIN, ("bmm",)),
    "mm": Case(lambda x: matrices(x)[0][0] @ matrices(x)[1][0] + torch.addmm(x[:1, :2], *(m[0] for m in matrices(x))), PLAIN[:1], ("mm", "addmm")),
    "mv, dot": Case(lambda x: (matrices(x)[0][0] @ x[0, :2] + x[0] @ x[0])[None], PLAIN[:1], ("mv", "dot")),
    "baddbmm": Case(lambda x: torch.baddbmm(matrices(x)[0], *matrices(x), beta=0.5, alpha=2.0), PLAIN, ("baddbmm",)),
    "einsum": Case(lambda x: torch.einsum("ij,bj,bk->bik", torch.tensor([[1.0, 0, 2], [0, 3, 0]], dtype=x.dtype), x, x), PLAIN, ()),
    "cat, stack": Case(lambda x: torch.cat([x, torch.stack([x[:, 0], x[:, 1] ** 2], 1)], 1), PLAIN, ("cat", "stack")),
    "shapes": Case(
        lambda x: x.unsqueeze(1).squeeze(1).reshape(-1, 3, 1).expand(-1, 3, 2).permute(0, 2, 1).transpose(1, 2).flatten(1)
        * x[:, [0, 0, 1, 1, 2, 2]].view(-1, 6),
        PLAIN, ("unsqueeze", "squeeze", "view", "expand", "permute", "transpose", "clone", "_unsafe_view"),
    ),
    "slices": Case(
        lambda x: x[:, 1] * x.unbind(1)[0] + x[:, ::2].sum(1) * x.split(2, 1)[1][:, 0] + x.split([1, 2], 1)[1][:, 1] * torch.ops.aten.alias(x)[..., -1],
        PLAIN, ("alias", "select", "slice", "unbind", "split", "split_with_sizes"),
    ),
    "index": Case(
        lambda x: x[:, INDEX] * x.index_select(1, INDEX) + x.gather(1, INDEX.expand(len(x), -1)) + x[:, MASK].sum(1, keepdim=True),
        PLAIN, ("index", "index_select", "gather"),
    ),
    "index, written": Case(
        lambda x: x.index_put((torch.arange(len(x))[:, None], INDEX), x[:, INDEX], accumulate=True)
        + x.index_add(1, INDEX, x[:, INDEX] ** 2, alpha=2.0) + x.scatter_add(1, INDEX.expand(len(x), -1), x[:, INDEX]),
        PLAIN, ("index_put", "index_add", "scatter_add"),
    ),
    "triangles": Case(
        lambda x: torch.tril(matrices(x)[0]) + torch.triu(matrices(x)[1], 1) + torch.diag_embed(x[:, :2])
        + matrices(x)[0].diagonal(dim1=1, dim2=2)[:, :, None] + torch.diag_embed(x[:, 0:1], 1),
        PLAIN, ("tril", "triu", "diag_embed", "diagonal"),
    ),
    "moves": Case(
        lambda x: x * x.flip(1) + x.roll(1, 1) ** 2 + x.repeat(1, 2)[:, 3:] + torch.nn.functional.pad(x, (1, 0), value=2.0)[:, :3] * x,
        PLAIN, ("flip", "roll", "repeat", "constant_pad_nd"),
    ),
    "new tensors": Case(
        lambda x: x * (torch.ones_like(x) + torch.full_like(x, 2.0) + x.new_full((3,), 0.5) + x.new_zeros(3) + x.new_ones(3)
                       + torch.empty_like(x).fill_(1.0) + x.new_empty(3).zero_() + torch.ones(3, dtype=x.dtype)),
        PLAIN, ("ones_like", "full_like", "new_full", "new_zeros", "new_ones", "empty_like", "new_empty", "fill", "zero"),
    ),
    "written in place": Case(written, PLAIN[:1], ("zeros_like", "copy", "add", "mul")),
    "conversions": Case(
        lambda x: x.to(x.dtype, copy=True) * (x > 0).to(x.dtype) + x * x.bool() + torch.t(x[0])[None], PLAIN[:1], ("_to_copy", "t"),
    ),
}  # fmt: skip


def as_step(case: Case) -> tuple[NativeStep, Tensor]:
    """The case as a step function: the state is the arguments, then the results; unused places are 0."""
    s = torch.tensor(case.points, dtype=torch.float64)
    n = s.shape[1]
    m = case.fn(s).reshape(len(s), -1).shape[1]

    def fn(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        y = case.fn(s[:, :n]).reshape(len(s), -1)
        return torch.cat([y, torch.zeros_like(s[:, m:])], dim=1) if s.shape[1] > m else y

    size = max(n, m)
    padded = torch.cat([s, s.new_zeros(len(s), size - n)], dim=1)
    return NativeStep(fn, size, 0, 0, key=""), padded


@pytest.mark.parametrize("name", CASES)
def test_an_operation_equals_torchs(name: str) -> None:
    """Value, vector-Jacobian and Jacobian-vector product are torch's, infinite and undefined ones included."""
    step, s = as_step(CASES[name])
    size = s.shape[1]
    u, p = s.new_zeros(len(s), 1, 0), s.new_zeros(len(s), 0)
    adjoint = torch.linspace(0.5, 1.5, 2 * s.numel(), dtype=s.dtype).reshape(len(s), 2, size)
    identity = torch.eye(size, dtype=s.dtype).expand(len(s), -1, -1)

    frames = step.forward(s, u, p, h=1.0)
    g_s, _, _ = step.vjp(s, u, p, adjoint, h=1.0)
    values, d_frames = step.jvp(s, u, p, ds0=identity, h=1.0)

    plan = {"h": 1.0, "hold": 1, "every": 1}
    torch.testing.assert_close(frames, eager.rollout(step.fn, s, u, p, **plan), rtol=1e-14, atol=1e-14, equal_nan=True)
    assert torch.equal(values.nan_to_num(), frames.nan_to_num())
    wanted = eager.vjp(step.fn, s, u, p, adjoint, **plan)[0]
    torch.testing.assert_close(g_s, wanted, rtol=1e-13, atol=1e-13, equal_nan=True)
    zeros = (identity, u.new_zeros(*u.shape, size), p.new_zeros(*p.shape, size))
    _, wanted = eager.jvp(step.fn, s, u, p, zeros, None, **plan)
    torch.testing.assert_close(d_frames, wanted, rtol=1e-13, atol=1e-13, equal_nan=True)


@pytest.mark.parametrize("fn", [torch.atan2, torch.hypot])
def test_functions_of_the_origin_are_flat_there(fn: Callable[[Tensor, Tensor], Tensor]) -> None:
    """Where torch's modes disagree (atan2: 0 and NaN) or give NaN (hypot), the derivative is 0, as that of a norm."""
    step, s = as_step(Case(lambda x: fn(x[:, :1], x[:, 1:]).expand(-1, 2), [[0.0, 0.0], [0.3, 0.4]], ()))
    u, p = s.new_zeros(2, 1, 0), s.new_zeros(2, 0)
    adjoint = torch.tensor([[[0.0, 0.0], [1.0, 0.0]]], dtype=s.dtype).expand(2, -1, -1)
    gradient = step.vjp(s, u, p, adjoint, h=1.0)[0]
    _, tangent = step.jvp(s, u, p, ds0=torch.eye(2, dtype=s.dtype).expand(2, -1, -1), h=1.0)
    there = s[1].clone().requires_grad_()
    wanted = torch.stack([torch.zeros(2, dtype=s.dtype), torch.autograd.grad(fn(*there), there)[0]])
    torch.testing.assert_close(gradient, wanted)
    torch.testing.assert_close(tangent[:, 1, 0], wanted)


def test_every_operation_has_a_case() -> None:
    """No operation of the tracer is left untested."""
    shown = {name for case in CASES.values() for name in case.aten}
    assert sorted(set(OPERATORS) - shown) == []

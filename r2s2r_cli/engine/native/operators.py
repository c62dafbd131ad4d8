"""The aten operations that can be traced: arithmetic, selection and reductions here, shapes in `shaping`.

An operation takes the trace and aten's arguments, and returns the nodes of its result (a list of them for a list of
tensors).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np

from r2s2r_cli.engine.native import elementwise as el
from r2s2r_cli.engine.native.elementwise import Scalar
from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.shaping import SHAPING
from r2s2r_cli.engine.native.symbolic import Nodes, Operation, Trace, TracingError

Axes = int | Sequence[int] | None


def mapped(trace: Trace, fn: Scalar, *args: Any) -> Nodes:
    """`fn` on every element of the broadcast arguments."""
    arrays = np.broadcast_arrays(*(trace.nodes(x) for x in args))
    g = trace.graph
    flat = [fn(g, *values) for values in zip(*(a.ravel().tolist() for a in arrays), strict=True)]
    return np.array(flat, dtype=np.int64).reshape(arrays[0].shape)


def _elementwise(fn: Scalar) -> Operation:
    # An option by name would change the result: unknown ones must fail, not be passed over.
    return lambda trace, *args: mapped(trace, fn, *args)


def _unary(name: str) -> Operation:
    fn = el.UNARY[name]
    if name in ("detach", "logical_not", "bitwise_not"):
        return _elementwise(fn)
    return _elementwise(lambda g, a: fn(g, el.real(g, a)))


def _add(trace: Trace, a: Any, b: Any, *, alpha: float = 1) -> Nodes:
    def total(g: Graph, x: int, y: int) -> int:
        if g.boolean(x) and g.boolean(y):
            return g.either(x, y)  # as torch has it: the sum of two truth values is one
        return g.add(el.real(g, x), g.mul(g.const(alpha), el.real(g, y)))

    return mapped(trace, total, a, b)


def _sub(trace: Trace, a: Any, b: Any, *, alpha: float = 1) -> Nodes:
    return mapped(trace, lambda g, x, y: g.sub(el.real(g, x), g.mul(g.const(alpha), el.real(g, y))), a, b)


def _div(trace: Trace, a: Any, b: Any, *, rounding_mode: str | None = None) -> Nodes:
    quotient = mapped(trace, el.quotient, a, b)
    if rounding_mode is None:
        return quotient
    return mapped(trace, el.UNARY[rounding_mode], trace.tensor(quotient))


def _round(trace: Trace, x: Any, *, decimals: int = 0) -> Nodes:
    scale = 10.0**decimals

    def rounded(g: Graph, a: int) -> int:
        scaled = g.apply("round", g.mul(el.real(g, a), g.const(scale)))
        return g.div(scaled, g.const(scale))

    return mapped(trace, rounded, x)


def _clamp(trace: Trace, a: Any, min: Any = None, max: Any = None) -> Nodes:
    result = trace.nodes(a)
    if min is not None:
        result = mapped(trace, el.clamp_min, trace.tensor(result), min)
    if max is not None:
        result = mapped(trace, el.clamp_max, trace.tensor(result), max)
    return result


def _where(trace: Trace, condition: Any, a: Any, b: Any) -> Nodes:
    def choose(g: Graph, c: int, x: int, y: int) -> int:
        if g.boolean(x) != g.boolean(y):
            x, y = el.real(g, x), el.real(g, y)
        return g.select(el.truth(g, c), x, y)

    return mapped(trace, choose, condition, a, b)


def _reduction(fn: Callable[[Graph, list[int]], int]) -> Operation:
    def reduce(trace: Trace, x: Any, dim: Axes = None, keepdim: bool = False, **_: Any) -> Nodes:
        nodes = trace.nodes(x)
        axes = tuple(range(nodes.ndim)) if dim is None or dim == [] else (dim,) if isinstance(dim, int) else tuple(dim)
        axes = tuple(sorted(axis % nodes.ndim for axis in axes)) if nodes.ndim else ()
        kept = tuple(k for k in range(nodes.ndim) if k not in axes)
        shape, each = tuple(nodes.shape[k] for k in kept), prod(nodes.shape[k] for k in axes)
        rows = nodes.transpose(*kept, *axes).reshape(prod(shape), each).tolist()
        result = np.array([fn(trace.graph, row) for row in rows], dtype=np.int64).reshape(shape)
        return np.expand_dims(result, axes) if keepdim else result

    return reduce


def _total(g: Graph, terms: list[int]) -> int:
    return g.sum(el.real(g, i) for i in terms)


def _product(g: Graph, terms: list[int]) -> int:
    result = g.const(1.0)
    for i in terms:
        result = g.mul(result, el.real(g, i))
    return result


def _all(g: Graph, terms: list[int]) -> int:
    result = g.true(True)
    for i in terms:
        result = g.both(result, el.truth(g, i))
    return result


def _norm(trace: Trace, x: Any, ord: float = 2, dim: Axes = None, keepdim: bool = False, **_: Any) -> Nodes:
    if ord == 2:
        return _reduction(el.norm)(trace, x, dim, keepdim)
    if ord == 1:
        return _reduction(lambda g, terms: g.sum(g.apply("abs", i) for i in terms))(trace, x, dim, keepdim)
    raise TracingError(f"vector_norm of order {ord} cannot be compiled")


def _matmul(trace: Trace, a: Any, b: Any) -> Nodes:
    """Batched matrix product (..., n, k) (..., k, m)."""
    x, y, g = trace.nodes(a), trace.nodes(b), trace.graph
    rows, columns = x.tolist(), y.swapaxes(-1, -2).tolist()

    def product(rows: Any, columns: Any, depth: int) -> Any:
        if depth:
            return [product(r, c, depth - 1) for r, c in zip(rows, columns, strict=True)]
        return [[g.sum(g.mul(p, q) for p, q in zip(r, c, strict=True)) for c in columns] for r in rows]

    shape = (*x.shape[:-1], y.shape[-1])
    return np.array(product(rows, columns, x.ndim - 2), dtype=np.int64).reshape(shape)


def _mv(trace: Trace, a: Any, b: Any) -> Nodes:
    column: Nodes = trace.nodes(b)[:, None]
    return _matmul(trace, a, trace.tensor(column))[:, 0]


def _dot(trace: Trace, a: Any, b: Any) -> Nodes:
    g = trace.graph
    pairs = zip(trace.nodes(a).tolist(), trace.nodes(b).tolist(), strict=True)
    return np.array(g.sum(g.mul(p, q) for p, q in pairs), dtype=np.int64)


def _plus_matmul(trace: Trace, c: Any, a: Any, b: Any, *, beta: float = 1, alpha: float = 1) -> Nodes:
    product = mapped(trace, el.BINARY["mul"], trace.tensor(_matmul(trace, a, b)), alpha)
    scaled = mapped(trace, el.BINARY["mul"], c, beta)
    return _add(trace, trace.tensor(scaled), trace.tensor(product))


def _cross(trace: Trace, a: Any, b: Any, dim: int = -1) -> Nodes:
    x, y = np.broadcast_arrays(trace.nodes(a), trace.nodes(b))
    x, y, g = np.moveaxis(x, dim, -1), np.moveaxis(y, dim, -1), trace.graph
    result = np.empty(x.shape, dtype=np.int64)
    for index in np.ndindex(*x.shape[:-1]):
        p, q = x[index].tolist(), y[index].tolist()
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            result[(*index, k)] = g.sub(g.mul(p[i], q[j]), g.mul(p[j], q[i]))
    return np.moveaxis(result, -1, dim)


def _cumsum(trace: Trace, x: Any, dim: int, **_: Any) -> Nodes:
    numbers = mapped(trace, el.real, x)  # of truth values it counts
    nodes = np.moveaxis(numbers, dim, 0)
    for k in range(1, len(nodes)):
        nodes[k] = _add(trace, trace.tensor(nodes[k - 1]), trace.tensor(nodes[k]))
    return np.moveaxis(nodes, 0, dim)


def _scaled_product(trace: Trace, c: Any, a: Any, b: Any, *, value: float = 1) -> Nodes:
    return mapped(trace, lambda g, z, x, y: g.add(z, g.mul(g.const(value), g.mul(x, y))), c, a, b)


OPERATORS: dict[str, Operation] = {
    **{name: _unary(name) for name in el.UNARY},
    **{name: _elementwise(fn) for name, fn in el.BINARY.items()},
    **SHAPING,
    "add": _add,
    "sub": _sub,
    "round": _round,
    "rsub": lambda trace, a, b, alpha=1: _sub(trace, b, a, alpha=alpha),
    "div": _div,
    "clamp": _clamp,
    "clamp_min": _elementwise(el.clamp_min),
    "clamp_max": _elementwise(el.clamp_max),
    "where": _where,
    "masked_fill": lambda trace, x, mask, value: _where(trace, mask, value, x),
    "lerp": _elementwise(lambda g, a, b, w: g.add(a, g.mul(w, g.sub(b, a)))),
    "addcmul": _scaled_product,
    "sum": _reduction(_total),
    "mean": _reduction(lambda g, terms: g.div(_total(g, terms), g.const(len(terms)))),
    "prod": _reduction(_product),
    "amax": _reduction(lambda g, terms: el.largest(g, terms, "max")),
    "amin": _reduction(lambda g, terms: el.largest(g, terms, "min")),
    "all": _reduction(_all),
    "any": _reduction(lambda g, terms: g.negation(_all(g, [g.negation(el.truth(g, i)) for i in terms]))),
    "linalg_vector_norm": _norm,
    "linalg_cross": _cross,
    "cumsum": _cumsum,
    "mm": _matmul,
    "bmm": _matmul,
    "mv": _mv,
    "dot": _dot,
    "addmm": _plus_matmul,
    "baddbmm": _plus_matmul,
}
"""Traced form of every aten operation that is known, by its name without overload."""

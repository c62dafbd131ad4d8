"""Derivatives of single operations, each torch's own formula; at singular points too."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from r2s2r_cli.engine.native.elementwise import sign
from r2s2r_cli.engine.native.graph import Graph

Linear = Callable[[int], int]
"""What an adjoint of the result (or a tangent of the argument) is multiplied to: both are the same product."""

FLAT = frozenset({"det", "floor", "ceil", "trunc", "round", "lt", "le", "eq", "and", "not", "true"})
"""Operations without derivative: the paper's detach, steps, and truth values."""


def flows(g: Graph, order: Sequence[int], sources: Iterable[int]) -> set[int]:
    """Nodes that have a derivative by any of the sources, these included."""
    found = set(sources)
    for i in order:
        op = g.ops[i]
        if op in FLAT:
            continue
        args: Collection[int] = g.arguments(i)
        if op in ("select", "call"):
            args = args[1:]  # type: ignore[index]
        if any(k in found for k in args):
            found.add(i)
    return found


def partials(g: Graph, op: str, y: int, args: Sequence[int]) -> list[Linear]:
    """For each argument of an operation with value y, how a change of it passes."""
    return _RULES[op](g, y, *args)


def _times(g: Graph, factor: int) -> Linear:
    return lambda t: g.mul(t, factor)


def _same(t: int) -> int:
    return t


def _mul(g: Graph, y: int, a: int, b: int) -> list[Linear]:
    return [_times(g, b), _times(g, a)]


def _div(g: Graph, y: int, a: int, b: int) -> list[Linear]:
    inverse = g.reciprocal(b)
    return [_times(g, inverse), lambda t: g.neg(g.mul(g.mul(t, inverse), y))]


def _select(g: Graph, y: int, c: int, a: int, b: int) -> list[Linear]:
    zero = g.const(0.0)
    return [lambda t: zero, lambda t: g.select(c, t, zero), lambda t: g.select(c, zero, t)]


def _extreme(g: Graph, a: int, b: int, *, low_first: bool) -> list[Linear]:
    """A tie is shared in halves. low_first: whether the smaller one passes."""
    zero, half, tie = g.const(0.0), g.const(0.5), g.compare("eq", a, b)
    below, above = g.compare("lt", a, b), g.compare("lt", b, a)
    lost = (above, below) if low_first else (below, above)

    def passing(out: int) -> Linear:
        return lambda t: g.select(out, zero, g.select(tie, g.mul(half, t), t))

    return [passing(lost[0]), passing(lost[1])]


def _power(g: Graph, y: int, a: int, b: int) -> list[Linear]:
    zero, one = g.const(0.0), g.const(1.0)
    flat = g.compare("eq", b, zero)
    slope = g.mul(b, g.apply("pow", a, g.sub(b, one)))
    still = g.both(g.compare("eq", a, zero), g.compare("le", zero, b))
    growth = g.mul(y, g.apply("log", a))
    return [
        lambda t: g.select(flat, zero, g.mul(t, slope)),
        lambda t: g.select(still, zero, g.mul(t, growth)),
    ]


def _atan2(g: Graph, y: int, a: int, b: int) -> list[Linear]:
    squares = g.add(g.mul(a, a), g.mul(b, b))
    inverse = g.reciprocal(g.select(g.compare("eq", squares, g.const(0.0)), g.const(1.0), squares))
    return [_times(g, g.mul(b, inverse)), lambda t: g.neg(g.mul(t, g.mul(a, inverse)))]


def _root(g: Graph, a: int) -> int:
    """1 / sqrt(1 - a^2)."""
    return g.reciprocal(g.apply("sqrt", g.sub(g.const(1.0), g.mul(a, a))))


_RULES: dict[str, Callable[..., list[Linear]]] = {
    "add": lambda g, y, a, b: [_same, _same],
    "sub": lambda g, y, a, b: [_same, g.neg],
    "neg": lambda g, y, a: [g.neg],
    "mul": _mul,
    "fma": lambda g, y, a, b, c: [*_mul(g, y, a, b), _same],
    "div": _div,
    "select": _select,
    "max": lambda g, y, a, b: _extreme(g, a, b, low_first=False),
    "min": lambda g, y, a, b: _extreme(g, a, b, low_first=True),
    "pow": _power,
    "atan2": _atan2,
    "sqrt": lambda g, y, a: [_times(g, g.mul(g.const(0.5), g.reciprocal(y)))],
    "abs": lambda g, y, a: [_times(g, sign(g, a))],
    "exp": lambda g, y, a: [_times(g, y)],
    "expm1": lambda g, y, a: [_times(g, g.add(y, g.const(1.0)))],
    "log": lambda g, y, a: [_times(g, g.reciprocal(a))],
    "log1p": lambda g, y, a: [_times(g, g.reciprocal(g.add(a, g.const(1.0))))],
    "sin": lambda g, y, a: [_times(g, g.apply("cos", a))],
    "cos": lambda g, y, a: [lambda t: g.neg(g.mul(t, g.apply("sin", a)))],
    "tan": lambda g, y, a: [_times(g, g.add(g.const(1.0), g.mul(y, y)))],
    "asin": lambda g, y, a: [_times(g, _root(g, a))],
    "acos": lambda g, y, a: [lambda t: g.neg(g.mul(t, _root(g, a)))],
    "atan": lambda g, y, a: [_times(g, g.reciprocal(g.add(g.const(1.0), g.mul(a, a))))],
    "sinh": lambda g, y, a: [_times(g, g.apply("cosh", a))],
    "cosh": lambda g, y, a: [_times(g, g.apply("sinh", a))],
    "tanh": lambda g, y, a: [_times(g, g.sub(g.const(1.0), g.mul(y, y)))],
}

"""Operations on single numbers, as torch means them: values at special arguments, and which side a tie favours.

The derivative follows from the operations chosen here, so each is written such that it equals torch's: relu'(0) = 0,
clamp passes its bounds, abs'(0) = 0, a tie of maximum is shared in halves.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log

from r2s2r_cli.engine.native.graph import Graph

Scalar = Callable[..., int]


def real(g: Graph, a: int) -> int:
    """A truth value as 1 or 0; numbers as they are."""
    return g.select(a, g.const(1.0), g.const(0.0)) if g.boolean(a) else a


def truth(g: Graph, a: int) -> int:
    """A number as truth value: whether it is not 0."""
    return a if g.boolean(a) else g.negation(g.compare("eq", a, g.const(0.0)))


def _apply(op: str) -> Scalar:
    return lambda g, *args: g.apply(op, *(real(g, a) for a in args))


def _compare(op: str, *, swapped: bool = False, negated: bool = False) -> Scalar:
    def compare(g: Graph, a: int, b: int) -> int:
        a, b = real(g, a), real(g, b)
        result = g.compare(op, b, a) if swapped else g.compare(op, a, b)
        return g.negation(result) if negated else result

    return compare


def relu(g: Graph, a: int) -> int:
    """max(a, 0), with derivative 0 at 0; NaN stays NaN."""
    zero = g.const(0.0)
    return g.select(g.compare("le", a, zero), zero, a)


def clamp_min(g: Graph, a: int, low: int) -> int:
    """At least `low`; on the bound the derivative goes to a."""
    return g.select(g.compare("lt", a, low), low, a)


def clamp_max(g: Graph, a: int, high: int) -> int:
    """At most `high`; on the bound the derivative goes to a."""
    return g.select(g.compare("lt", high, a), high, a)


def sign(g: Graph, a: int) -> int:
    """-1, 0 or 1."""
    zero = g.const(0.0)
    down = g.select(g.compare("lt", a, zero), g.const(-1.0), zero)
    return g.select(g.compare("lt", zero, a), g.const(1.0), down)


def power(g: Graph, a: int, b: int) -> int:
    """The power a^b: products and roots where the exponent is a small multiple of one half."""
    a, b = real(g, a), real(g, b)
    n = g.value(b)
    if n is None or abs(n) > 16 or n * 2 != int(n * 2):
        return g.apply("pow", a, b)
    if n < 0:
        return g.reciprocal(power(g, a, g.const(-n)))
    result = g.const(1.0) if n == int(n) else g.apply("sqrt", a) if n < 1 else _flat_root(g, a)
    square, left = a, int(n)
    while left:
        if left % 2:
            result = g.mul(result, square)
        left //= 2
        square = g.mul(square, square) if left else square
    return result


def sigmoid(g: Graph, a: int) -> int:
    """1 / (1 + exp(-a)), written so that nothing overflows."""
    positive = g.compare("le", g.const(0.0), a)
    small = g.apply("exp", g.select(positive, g.neg(a), a))
    denominator = g.add(g.const(1.0), small)
    return g.div(g.select(positive, g.const(1.0), small), denominator)


def _flat_root(g: Graph, a: int) -> int:
    """Square root with derivative 0 at 0, for where it meets a factor 0 there: infinity times 0 would be NaN."""
    zero = g.const(0.0)
    at_zero = g.compare("eq", a, zero)
    return g.select(at_zero, zero, g.apply("sqrt", g.select(at_zero, g.const(1.0), a)))


def norm(g: Graph, terms: list[int]) -> int:
    """Euclidean norm, with derivative 0 at 0: the root is never taken of 0."""
    return _flat_root(g, g.sum(g.mul(i, i) for i in terms))


def largest(g: Graph, terms: list[int], op: str) -> int:
    """Maximum ("max") or minimum ("min") of all; a tie shares the derivative evenly."""
    if len(terms) == 1:
        return terms[0]
    best = terms[0]
    for i in terms[1:]:
        best = g.apply(op, best, i)
    best = g.apply("det", best)
    one, zero = g.const(1.0), g.const(0.0)
    shares = [g.select(g.compare("eq", i, best), one, zero) for i in terms]

    def carrier(share: int, i: int) -> int:
        """A term of value 0 that carries the derivative alone, of what is finite: infinity less itself is NaN."""
        endless = g.compare("eq", g.apply("abs", i), g.const(float("inf")))
        return g.select(endless, zero, g.mul(share, g.sub(i, g.apply("det", i))))

    carried = g.sum(carrier(share, i) for share, i in zip(shares, terms, strict=True) if g.value(i) is None)
    return g.add(best, g.div(carried, g.sum(shares)))


def _xor(g: Graph, a: int, b: int) -> int:
    a, b = truth(g, a), truth(g, b)
    return g.select(a, g.negation(b), b)


def quotient(g: Graph, a: int, b: int) -> int:
    """Quotient of two numbers or truth values."""
    return g.div(real(g, a), real(g, b))


def _mul(g: Graph, a: int, b: int) -> int:
    """The product; of two truth values, whether both hold: torch's is a truth value again."""
    return g.both(a, b) if g.boolean(a) and g.boolean(b) else g.mul(real(g, a), real(g, b))


UNARY: dict[str, Scalar] = {
    **{op: _apply(op) for op in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp")},
    **{op: _apply(op) for op in ("expm1", "log", "log1p", "abs", "floor", "ceil", "trunc", "round")},
    "neg": lambda g, a: g.neg(a),
    "reciprocal": lambda g, a: g.reciprocal(a),
    "rsqrt": lambda g, a: g.reciprocal(g.apply("sqrt", a)),
    "square": lambda g, a: g.mul(a, a),
    "relu": relu,
    "sign": sign,
    "sgn": sign,
    "sigmoid": sigmoid,
    "log2": lambda g, a: g.mul(g.apply("log", a), g.const(1.0 / log(2.0))),
    "log10": lambda g, a: g.mul(g.apply("log", a), g.const(1.0 / log(10.0))),
    "exp2": lambda g, a: g.apply("exp", g.mul(a, g.const(log(2.0)))),
    "frac": lambda g, a: g.sub(a, g.apply("trunc", a)),
    "deg2rad": lambda g, a: g.mul(a, g.const(0.017453292519943295)),
    "detach": lambda g, a: a if g.boolean(a) else g.apply("det", a),
    "isnan": lambda g, a: g.negation(g.compare("eq", a, a)),
    "isinf": lambda g, a: g.compare("eq", g.apply("abs", a), g.const(float("inf"))),
    "isfinite": lambda g, a: g.compare("lt", g.apply("abs", a), g.const(float("inf"))),
    "logical_not": lambda g, a: g.negation(truth(g, a)),
    "bitwise_not": lambda g, a: g.negation(truth(g, a)),
}
"""Functions of one number."""

BINARY: dict[str, Scalar] = {
    "mul": _mul,
    "maximum": _apply("max"),
    "minimum": _apply("min"),
    "pow": power,
    "atan2": _apply("atan2"),
    "hypot": lambda g, a, b: norm(g, [a, b]),
    "eq": _compare("eq"),
    "ne": _compare("eq", negated=True),
    "lt": _compare("lt"),
    "le": _compare("le"),
    "gt": _compare("lt", swapped=True),
    "ge": _compare("le", swapped=True),
    "logical_and": lambda g, a, b: g.both(truth(g, a), truth(g, b)),
    "logical_or": lambda g, a, b: g.either(truth(g, a), truth(g, b)),
    "logical_xor": _xor,
    "bitwise_and": lambda g, a, b: g.both(truth(g, a), truth(g, b)),
    "bitwise_or": lambda g, a, b: g.either(truth(g, a), truth(g, b)),
    "bitwise_xor": _xor,
}
"""Functions of two numbers."""

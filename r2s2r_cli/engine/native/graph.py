"""Scalar programs: a graph of numbers that folds constants.

Folding drops what is multiplied by the constant zero: where torch would make NaN of 0 * inf, the program makes 0. That
is the only liberty it takes with special values.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np

from r2s2r_cli.engine.native.nodes import Nodes

_FOLD: dict[str, Any] = {
    "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "tanh": np.tanh,
    "sinh": np.sinh, "cosh": np.cosh, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "abs": np.abs,
    "floor": np.floor, "ceil": np.ceil, "trunc": np.trunc, "round": np.round, "expm1": np.expm1, "log1p": np.log1p,
    "atan2": np.arctan2, "pow": np.power, "min": np.minimum, "max": np.maximum, "div": np.divide,
}  # fmt: skip


@dataclass(frozen=True)
class Subroutine:
    """A program that other programs call: `tangents` of its inputs "x" come with as many inputs "dx" when it is dual,
    and then its outputs are values followed by their tangents."""

    graph: Graph
    outputs: tuple[int, ...]
    n_inputs: int
    dual: bool = False


@dataclass
class Graph(Nodes):
    """Nodes, made by folding. `derived` tells which subroutine is another's derivative."""

    subroutines: list[Subroutine] = field(default_factory=list)
    derived: dict[tuple[int, str], int] = field(default_factory=dict)

    def add(self, a: int, b: int) -> int:
        """Sum of a and b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x + y)
        if x == 0:
            return b
        if y == 0:
            return a
        if self.ops[b] == "neg":
            return self.sub(a, self.args[b][0])
        if self.ops[a] == "neg":
            return self.sub(b, self.args[a][0])
        return self.node("add", a, b)

    def sub(self, a: int, b: int) -> int:
        """Difference of a and b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x - y)
        if y == 0:
            return a
        if x == 0:
            return self.neg(b)
        if self.ops[b] == "neg":
            return self.add(a, self.args[b][0])
        return self.node("sub", a, b)

    def neg(self, a: int) -> int:
        """-a."""
        x = self.value(a)
        if x is not None:
            return self.const(-x)
        if self.ops[a] == "neg":
            return int(self.args[a][0])
        if self.ops[a] == "sub":
            return self.node("sub", self.args[a][1], self.args[a][0])
        return self.node("neg", a)

    def mul(self, a: int, b: int) -> int:
        """Product of a and b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x * y)
        if x is not None:
            return self._scale(x, b)
        if y is not None:
            return self._scale(y, a)
        if self.ops[a] == "neg":
            return self.neg(self.mul(self.args[a][0], b))
        if self.ops[b] == "neg":
            return self.neg(self.mul(a, self.args[b][0]))
        return self.node("mul", a, b)

    def _scale(self, x: float, b: int) -> int:
        if x == 0:
            return self.const(0.0)
        if x == 1:
            return b
        if x == -1:
            return self.neg(b)
        if self.ops[b] == "neg":
            return self._scale(-x, self.args[b][0])
        if self.ops[b] == "mul":
            y = self.value(self.args[b][0])
            if y is not None:
                return self._scale(x * y, self.args[b][1])
            y = self.value(self.args[b][1])
            if y is not None:
                return self._scale(x * y, self.args[b][0])
        return self.node("mul", self.const(x), b)

    def div(self, a: int, b: int) -> int:
        """Quotient a / b; a constant divisor becomes a factor, good to one rounding."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.apply("div", a, b)
        if y is not None and y != 0:
            return self._scale(1.0 / y, a)
        if x == 0:
            return a
        if self.ops[b] == "neg":
            return self.neg(self.div(a, self.args[b][0]))
        return self.node("div", a, b)

    def reciprocal(self, a: int) -> int:
        """1 / a."""
        return self.div(self.const(1.0), a)

    def apply(self, op: str, *args: int) -> int:
        """Any operation that has no rule of folding but that of constants."""
        values = [self.value(i) for i in args]
        if op in _FOLD and None not in values:
            with np.errstate(all="ignore"):
                return self.const(float(_FOLD[op](*[np.float64(v) for v in values])))
        if op == "det" and (values[0] is not None or self.ops[args[0]] == "det"):
            return args[0]
        return self.node(op, *args)

    def compare(self, op: str, a: int, b: int) -> int:
        """Truth of a < b ("lt"), a <= b ("le") or a == b ("eq"); false beside a NaN."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.true({"lt": x < y, "le": x <= y, "eq": x == y}[op])
        return self.node(op, a, b)

    def negation(self, a: int) -> int:
        """Whether a does not hold."""
        x = self.truth(a)
        if x is not None:
            return self.true(not x)
        return int(self.args[a][0]) if self.ops[a] == "not" else self.node("not", a)

    def both(self, a: int, b: int) -> int:
        """Whether a and b hold."""
        for x, other in ((self.truth(a), b), (self.truth(b), a)):
            if x is not None:
                return other if x else self.true(False)
        return a if a == b else self.node("and", a, b)

    def either(self, a: int, b: int) -> int:
        """Whether a or b holds."""
        return self.negation(self.both(self.negation(a), self.negation(b))) if a != b else a

    def select(self, condition: int, a: int, b: int) -> int:
        """The value a where the condition holds, else b; for numbers and truth values."""
        known = self.truth(condition)
        if known is not None:
            return a if known else b
        if self.ops[condition] == "not":
            condition, a, b = self.args[condition][0], b, a
        if self.ops[a] == "select" and self.args[a][0] == condition:
            a = self.args[a][1]
        if self.ops[b] == "select" and self.args[b][0] == condition:
            b = self.args[b][2]
        if a == b:
            return a
        if self.boolean(a):
            return self.either(self.both(condition, a), self.both(self.negation(condition), b))
        return self.node("select", condition, a, b)

    def sum(self, terms: Iterable[int]) -> int:
        """Sum, in groups of four so that the processor need not wait for each addition. Products come last in a group:
        each can then be fused into its addition."""
        terms = sorted((i for i in terms if self.value(i) != 0), key=self._product)
        if not terms:
            return self.const(0.0)
        while len(terms) > 1:
            terms = [reduce(self.add, terms[k : k + 4]) for k in range(0, len(terms), 4)]
        return terms[0]

    def _product(self, i: int) -> bool:
        return self.ops[i] == "mul" or (self.ops[i] == "neg" and self.ops[self.args[i][0]] == "mul")

    def call(self, number: int, flag: int, inputs: Sequence[int], otherwise: Sequence[int]) -> list[int]:
        """Outputs of subroutine `number` where the flag holds, else `otherwise`."""
        known = self.truth(flag)
        if known is False:
            return list(otherwise)
        call = self.node("call", number, flag, tuple(inputs), tuple(otherwise))
        return [self.node("get", call, k) for k in range(len(otherwise))]

    def subroutine(self, new: Subroutine) -> int:
        """Number of the subroutine; one that is already there, node for node, is shared."""
        for number, old in enumerate(self.subroutines):
            same = old.outputs == new.outputs and old.n_inputs == new.n_inputs and old.dual == new.dual
            if same and old.graph.ops == new.graph.ops and old.graph.args == new.graph.args:
                return number
        self.subroutines.append(new)
        return len(self.subroutines) - 1

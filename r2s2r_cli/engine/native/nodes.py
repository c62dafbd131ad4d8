"""Nodes of a scalar program by number: the same operation on the same arguments is never there twice.

A node is an integer; its arguments always have smaller integers, so the order of creation is a valid order of
evaluation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

COMMUTATIVE = frozenset({"add", "mul", "min", "max", "eq", "and", "or"})
BOOLEAN = frozenset({"true", "lt", "le", "eq", "and", "or", "not"})
"""Operations whose value is a truth value; "true" is the constant."""


@dataclass
class Nodes:
    """`ops[i]` and `args[i]` of each node.

    Arguments are nodes, but for "const" (a float), "true" (a bool), "in" (kind, index), "get" (call, index) and "call"
    (number of the subroutine, flag, inputs, otherwise).
    """

    ops: list[str] = field(default_factory=list)
    args: list[tuple[Any, ...]] = field(default_factory=list)
    _known: dict[tuple[Any, ...], int] = field(default_factory=dict)

    def node(self, op: str, *args: Any) -> int:
        """The node of this operation, new if there is none; nothing is folded."""
        if op in COMMUTATIVE and args[0] > args[1]:
            args = (args[1], args[0])
        key = (op, *args)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = len(self.ops)
            self.ops.append(op)
            self.args.append(args)
        return found

    def const(self, value: float) -> int:
        """A number. Not-a-number is one node, and so are both zeros."""
        value = float(value)
        key = ("const", "nan") if value != value else ("const", value)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = len(self.ops)
            self.ops.append("const")
            self.args.append((value + 0.0,))
        return found

    def true(self, value: bool) -> int:
        """A constant truth value."""
        return self.node("true", bool(value))

    def value(self, i: int) -> float | None:
        """The number of a constant node, else None."""
        return self.args[i][0] if self.ops[i] == "const" else None

    def truth(self, i: int) -> bool | None:
        """The truth of a constant node, else None."""
        return self.args[i][0] if self.ops[i] == "true" else None

    def boolean(self, i: int) -> bool:
        """Whether the node is a truth value."""
        return self.ops[i] in BOOLEAN

    def arguments(self, i: int) -> tuple[int, ...]:
        """The nodes that node i reads."""
        op, args = self.ops[i], self.args[i]
        if op in ("const", "true", "in"):
            return ()
        if op == "call":
            return (args[1], *args[2], *args[3])
        if op == "get":
            return (args[0],)
        return args

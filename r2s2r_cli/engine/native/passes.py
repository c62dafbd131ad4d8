"""What is done to a scalar program before it is emitted: fused products, shared divisions, order, what is constant.

Fusing and sharing are decided on the traced step, before it is differentiated. So the state that a derivative kernel
passes through is bit for bit the forward kernel's, and one lane is bit for bit the same as many.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from r2s2r_cli.engine.native.graph import Graph, Subroutine

LATENCY = {
    "add": 4, "sub": 4, "mul": 4, "fma": 4, "neg": 1, "det": 0, "select": 3, "lt": 3, "le": 3, "eq": 3, "min": 4,
    "max": 4, "sqrt": 18, "div": 13, "call": 40, "get": 0, "const": 0, "in": 0, "true": 0, "and": 1, "not": 1,
}  # fmt: skip
"""Cycles until the value is there, about; functions of the mathematical library take 40."""

BUCKET = 40
"""Nodes are emitted by depth in units of this many cycles: independent chains of divisions then run side by side
(contact.md section 6, trap 9)."""


def live(g: Graph, outputs: Iterable[int]) -> list[int]:
    """All nodes that the outputs need, in order."""
    keep: set[int] = set()
    stack = list(outputs)
    while stack:
        i = stack.pop()
        if i not in keep:
            keep.add(i)
            stack.extend(g.arguments(i))
    return sorted(keep)


def depths(g: Graph, nodes: Sequence[int]) -> dict[int, int]:
    """Cycles until each node is there, about."""
    depth: dict[int, int] = {}
    for i in nodes:
        before = max((depth.get(k, 0) for k in g.arguments(i)), default=0)
        depth[i] = before + LATENCY.get(g.ops[i], 40)
    return depth


def depth_order(g: Graph, nodes: Sequence[int]) -> list[int]:
    """The same nodes, sorted by depth; still an order of evaluation."""
    depth = depths(g, nodes)
    return sorted(nodes, key=lambda i: (depth[i] // BUCKET, i))


def shared(g: Graph, outputs: Sequence[int]) -> tuple[Graph, list[int]]:
    """The program with several divisions by one number made multiplications by its reciprocal."""
    order = live(g, outputs)
    divided = Counter(g.args[i][1] for i in order if g.ops[i] == "div")
    new = Graph(subroutines=g.subroutines, derived=g.derived)
    to: dict[int, int] = {}
    for i in order:
        op, args = g.ops[i], g.args[i]
        if op == "div" and divided[args[1]] > 1:
            to[i] = new.mul(to[args[0]], new.reciprocal(to[args[1]]))
        else:
            to[i] = copied(new, op, args, to)
    return new, [to[i] for i in outputs]


def fused(g: Graph, outputs: Sequence[int]) -> tuple[Graph, list[int]]:
    """The program with products that only one sum reads put into it, and what nobody reads left out."""
    order = live(g, outputs)
    uses = Counter(k for i in order for k in g.arguments(i))
    uses.update(outputs)
    new = Graph(subroutines=g.subroutines, derived=g.derived)
    to: dict[int, int] = {}

    def single(i: int) -> bool:
        return g.ops[i] == "mul" and uses[i] == 1

    for i in order:
        op, args = g.ops[i], g.args[i]
        if op in ("add", "sub") and (single(args[0]) or single(args[1])):
            first = not single(args[1])
            product = g.args[args[0] if first else args[1]]
            x, y, z = to[product[0]], to[product[1]], to[args[1] if first else args[0]]
            if op == "sub" and first:
                z = new.neg(z)
            elif op == "sub":
                x = new.neg(x)
            to[i] = new.node("fma", x, y, z)
        else:
            to[i] = copied(new, op, args, to)
    return new, [to[i] for i in outputs]


def simplified_subroutine(sub: Subroutine) -> Subroutine:
    """The subroutine, its divisions shared and its products fused."""
    graph, outputs = fused(*shared(sub.graph, sub.outputs))
    return Subroutine(graph, tuple(outputs), sub.n_inputs, sub.dual)


def copied(new: Graph, op: str, args: tuple, to: dict[int, int]) -> int:
    """The node (op, args) in another graph, `to` telling where its arguments are."""
    if op == "const":
        return new.const(args[0])
    if op in ("true", "in"):
        return new.node(op, *args)
    if op == "call":
        return new.node(op, args[0], to[args[1]], tuple(to[i] for i in args[2]), tuple(to[i] for i in args[3]))
    if op == "get":
        return new.node(op, to[args[0]], args[1])
    return new.node(op, *(to[i] for i in args))

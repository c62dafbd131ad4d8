"""Forward mode on scalar programs: a program of values and tangents, by torch's rules for each operation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from r2s2r_cli.engine.native.graph import Graph, Subroutine
from r2s2r_cli.engine.native.partials import FLAT, partials
from r2s2r_cli.engine.native.passes import copied, fused, live


def dual(
    g: Graph, outputs: Sequence[int], seed: Callable[[Graph, str, int], int | None], new: Graph
) -> tuple[list[int], list[int]]:
    """Values and tangents of the outputs, as nodes of `new`.

    seed: the tangent of an input (kind, index) in `new`, None if it has none. Outputs without tangent have 0.
    """
    to: dict[int, int] = {}
    tangent: dict[int, int] = {}
    zero = new.const(0.0)
    for i in live(g, outputs):
        op, args = g.ops[i], g.args[i]
        if op == "call" and any(k in tangent for k in (*args[2], *args[3])):
            to[i] = _dual_call(new, args, to, tangent)
        elif op == "get" and new.subroutines[new.args[to[args[0]]][0]].dual:
            call = to[args[0]]
            n = len(new.args[call][3]) // 2
            to[i] = new.node("get", call, args[1])
            tangent[i] = new.node("get", call, n + args[1])
        else:
            to[i] = copied(new, op, args, to)
        if op == "in":
            found = seed(new, *args)
            if found is not None:
                tangent[i] = found
        elif op not in FLAT and op not in ("const", "call", "get"):
            changes = [(k, tangent[k]) for k in args if k in tangent]
            if changes:
                result = _tangent(new, op, to[i], [to[k] for k in args], [tangent.get(k) for k in args])
                if new.value(result) != 0:
                    tangent[i] = result
    return [to[i] for i in outputs], [tangent.get(i, zero) for i in outputs]


def _tangent(g: Graph, op: str, y: int, args: Sequence[int], tangents: Sequence[int | None]) -> int:
    """Tangent of one operation. Quotients and selections are put together; the rest are sums of products."""
    zero = g.const(0.0)
    if op == "select":
        return g.select(args[0], *(zero if t is None else t for t in tangents[1:]))
    if op == "div":
        a, b = (zero if t is None else t for t in tangents)
        return g.mul(g.sub(a, g.mul(b, y)), g.reciprocal(args[1]))
    parts = zip(partials(g, op, y, args), tangents, strict=True)
    return g.sum(partial(t) for partial, t in parts if t is not None)


def _dual_call(new: Graph, args: tuple, to: dict[int, int], tangent: dict[int, int]) -> int:
    number, flag, inputs, otherwise = args
    zero = new.const(0.0)
    both = [(*(to[i] for i in nodes), *(tangent.get(i, zero) for i in nodes)) for nodes in (inputs, otherwise)]
    return new.node("call", dual_subroutine(new, number), to[flag], *both)


def dual_subroutine(g: Graph, number: int) -> int:
    """Number of the subroutine (inputs, tangents) -> (outputs, tangents), made once."""
    known = g.derived.get((number, "dual"))
    if known is not None:
        return known
    sub = g.subroutines[number]
    new = Graph()
    values, tangents = dual(sub.graph, sub.outputs, lambda g, _, k: g.node("in", "dx", k), new)
    graph, outputs = fused(new, [*values, *tangents])
    number_dual = g.subroutine(Subroutine(graph, tuple(outputs), sub.n_inputs, dual=True))
    g.derived[number, "dual"] = number_dual
    return number_dual

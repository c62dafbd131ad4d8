"""Reverse mode on scalar programs: adjoints of every node, by torch's rules for each operation."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from r2s2r_cli.engine.native.graph import Graph, Subroutine
from r2s2r_cli.engine.native.partials import FLAT, flows, partials
from r2s2r_cli.engine.native.passes import copied, fused, live


def adjoints(
    g: Graph, order: Sequence[int], seeds: Mapping[int, int], wanted: Collection[int], stop: Collection[int] = ()
) -> dict[int, int]:
    """Adjoint node of every wanted node, for adjoints `seeds` of some.

    order: nodes that may pass adjoints on, in order of evaluation. Nodes that are not in `wanted` get none, so neither
    do the nodes behind them. Nodes in `stop` keep theirs.
    """
    terms: dict[int, list[int]] = {}
    result: dict[int, int] = {}
    called: dict[int, dict[int, int]] = {}

    def give(i: int, a: int) -> None:
        if i in wanted and g.value(a) != 0:
            terms.setdefault(i, []).append(a)

    for i, a in seeds.items():
        give(i, a)
    for i in reversed(order):
        op, args = g.ops[i], g.args[i]
        if op == "call" and i in called:
            _through_call(g, i, called[i], give)
        if i not in terms:
            continue
        a = result[i] = g.sum(terms[i])
        if i in stop:
            continue
        if op == "get":
            called.setdefault(args[0], {})[args[1]] = a
        elif op != "in" and op not in FLAT:
            for k, partial in zip(args, partials(g, op, i, args), strict=True):
                if k in wanted:
                    give(k, partial(a))
    return result


def _through_call(g: Graph, i: int, given: Mapping[int, int], give: Callable[[int, int], None]) -> None:
    """Adjoints of a guarded call: of its inputs by a guarded call, of what it returns otherwise by selection."""
    number, flag, inputs, otherwise = g.args[i]
    zero = g.const(0.0)
    outer = [given.get(k, zero) for k in range(len(otherwise))]
    back = g.call(reversed_subroutine(g, number), flag, [*inputs, *outer], [zero] * len(inputs))
    for k, a in zip(inputs, back, strict=True):
        give(k, a)
    for k, a in zip(otherwise, outer, strict=True):
        give(k, g.select(flag, zero, a))


def reversed_subroutine(g: Graph, number: int) -> int:
    """Number of the subroutine (inputs, adjoints of outputs) -> adjoints of inputs, made once."""
    known = g.derived.get((number, "reverse"))
    if known is not None:
        return known
    sub = g.subroutines[number]
    new = Graph()
    order = live(sub.graph, sub.outputs)
    to: dict[int, int] = {}
    for i in order:
        to[i] = copied(new, sub.graph.ops[i], sub.graph.args[i], to)
    inputs = [new.node("in", "x", k) for k in range(sub.n_inputs)]
    seeds: dict[int, int] = {}
    for k, i in enumerate(sub.outputs):
        a = new.node("in", "x", sub.n_inputs + k)
        seeds[to[i]] = new.add(seeds[to[i]], a) if to[i] in seeds else a
    reached = live(new, seeds)
    found = adjoints(new, reached, seeds, flows(new, reached, inputs))
    graph, outputs = fused(new, [found.get(i, new.const(0.0)) for i in inputs])
    number_back = g.subroutine(Subroutine(graph, tuple(outputs), sub.n_inputs + len(sub.outputs)))
    g.derived[number, "reverse"] = number_back
    return number_back

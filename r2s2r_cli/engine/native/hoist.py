"""Which values of a program stay the same during a rollout, and are computed once before its loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.passes import depth_order, live

CONSTANT_KINDS = frozenset({"p", "h", "dp"})
"""Inputs that a rollout does not change."""


@dataclass(frozen=True)
class Hoisted:
    """before: nodes to compute before the loop, in order. kept: those of them that the loop reads. inside: nodes of the
    loop, in order. Truth values are computed inside again, since they cannot be kept in memory as lanes."""

    before: tuple[int, ...]
    kept: tuple[int, ...]
    inside: tuple[int, ...]


def invariant(g: Graph, order: Sequence[int]) -> set[int]:
    """Nodes that depend on parameters, the step and constants only. Results of subroutines are left where they are."""
    found: set[int] = set()
    for i in order:
        op = g.ops[i]
        if op == "in":
            same = g.args[i][0] in CONSTANT_KINDS
        else:
            same = op not in ("call", "get") and all(k in found for k in g.arguments(i))
        if same:
            found.add(i)
    return found


def hoisted(g: Graph, outputs: Sequence[int]) -> Hoisted:
    """Split the program of the loop."""
    order = live(g, outputs)
    same = invariant(g, order)
    plain = ("const", "true", "in")
    kept: set[int] = set()
    inside = {i for i in order if i not in same}
    stack = [k for i in inside for k in g.arguments(i) if k in same] + [i for i in outputs if i in same]
    while stack:
        i = stack.pop()
        if g.ops[i] in plain or i in kept or i in inside:
            continue
        if g.boolean(i):
            inside.add(i)
            stack.extend(g.arguments(i))
        else:
            kept.add(i)
    before = [i for i in live(g, kept) if g.ops[i] not in plain]
    return Hoisted(tuple(depth_order(g, before)), tuple(sorted(kept)), tuple(depth_order(g, sorted(inside))))

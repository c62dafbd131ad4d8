"""The programs of the three kernels, from the traced step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import torch

from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.hoist import invariant
from r2s2r_cli.engine.native.partials import flows
from r2s2r_cli.engine.native.passes import fused, live, shared, simplified_subroutine
from r2s2r_cli.engine.native.reverse import adjoints
from r2s2r_cli.engine.native.symbolic import StepFn, trace_step
from r2s2r_cli.engine.native.tangent import dual


@dataclass(frozen=True)
class Active:
    """Which inputs of a rollout may carry a tangent. state: the initial state. inputs: the commands. parameters: these
    places of the parameter vector."""

    state: bool
    inputs: bool
    parameters: tuple[int, ...]


@dataclass(frozen=True)
class Forward:
    """The step. state: nodes of the next state."""

    graph: Graph
    state: tuple[int, ...]
    n_input: int
    n_param: int

    def operations(self) -> int:
        """Number of nodes."""
        return len(live(self.graph, self.state))


@dataclass(frozen=True)
class Backward:
    """Vector-Jacobian product of the step, for adjoints ("a", k) of the next state: of the state, the inputs and what
    is hoisted; and, for adjoints ("q", k) of what is hoisted, of the parameters."""

    graph: Graph
    state: tuple[int, ...]
    inputs: tuple[int, ...]
    kept: tuple[int, ...]
    parameters: tuple[int, ...]

    @property
    def n_input(self) -> int:
        """Length of a row of inputs."""
        return len(self.inputs)

    def operations(self) -> int:
        """Number of nodes."""
        return len(live(self.graph, (*self.state, *self.inputs, *self.kept, *self.parameters)))


@dataclass(frozen=True)
class Tangent:
    """The step and its Jacobian-vector product, for tangents "ds", "du" and "dp" (by place in the active list)."""

    graph: Graph
    state: tuple[int, ...]
    tangents: tuple[int, ...]
    n_input: int

    def operations(self) -> int:
        """Number of nodes."""
        return len(live(self.graph, (*self.state, *self.tangents)))


def forward_program(fn: StepFn, n_state: int, n_input: int, n_param: int, dtype: torch.dtype) -> Forward:
    """Trace the step. Raises TracingError."""
    traced, outputs = trace_step(fn, n_state, n_input, n_param, dtype)
    graph, state = fused(*shared(traced, outputs))
    graph.subroutines = [simplified_subroutine(sub) for sub in traced.subroutines]
    return Forward(graph, tuple(state), n_input, n_param)


def _copy(g: Graph, outputs: Sequence[int]) -> tuple[Graph, list[int]]:
    """The live part of a program, to be added to: the original is shared between kernels."""
    graph, nodes = fused(g, outputs)
    graph.subroutines, graph.derived = list(g.subroutines), dict(g.derived)
    return graph, nodes


def backward_program(forward: Forward) -> Backward:
    """The step's vector-Jacobian product by state, inputs and parameters.

    Reverse mode stops at what is hoisted out of the loop, and goes on from there to the parameters after it.
    """
    g, outputs = _copy(forward.graph, forward.state)
    n_state = len(outputs)
    order = live(g, outputs)
    sources = {
        kind: [g.node("in", kind, k) for k in range(n)]
        for kind, n in (("s", n_state), ("u", forward.n_input), ("p", forward.n_param))
    }
    wanted = flows(g, order, [i for nodes in sources.values() for i in nodes])
    before = {i for i in invariant(g, order) if not g.boolean(i)}
    seeds: dict[int, int] = {}
    for k, i in enumerate(outputs):
        a = g.node("in", "a", k)
        seeds[i] = g.add(seeds[i], a) if i in seeds else a
    found = adjoints(g, order, seeds, wanted, stop=before)
    zero = g.const(0.0)
    kept = [i for i in order if i in before and i in found]
    after = adjoints(
        g, [i for i in order if i in before], {i: g.node("in", "q", k) for k, i in enumerate(kept)}, wanted
    )
    groups = [
        [found.get(i, zero) for i in sources["s"]],
        [found.get(i, zero) for i in sources["u"]],
        [found[i] for i in kept],
        [after.get(i, zero) for i in sources["p"]],
    ]
    new, nodes = fused(g, [i for group in groups for i in group])
    ends = [sum(len(group) for group in groups[:k]) for k in range(5)]
    return Backward(new, *(tuple(nodes[a:b]) for a, b in pairwise(ends)))


def tangent_program(forward: Forward, active: Active) -> Tangent:
    """The step's Jacobian-vector product; tangents that are always zero are left out."""
    g, order = forward.graph, live(forward.graph, forward.state)
    places = {k: i for i, k in enumerate(active.parameters)}
    varied = {g.node("in", "p", k) for k in places}
    if active.inputs:
        varied |= {g.node("in", "u", k) for k in range(forward.n_input)}
    moving = set(range(len(forward.state))) if active.state else set()
    while True:
        reached = flows(g, order, varied | {g.node("in", "s", k) for k in moving})
        now = moving | {k for k, i in enumerate(forward.state) if i in reached}
        if now == moving:
            break
        moving = now

    def seed(new: Graph, kind: str, index: int) -> int | None:
        if kind == "s":
            return new.node("in", "ds", index) if index in moving else None
        if kind == "u":
            return new.node("in", "du", index) if active.inputs else None
        return new.node("in", "dp", places[index]) if kind == "p" and index in places else None

    new = Graph(subroutines=list(g.subroutines), derived=dict(g.derived))
    values, tangents = dual(g, forward.state, seed, new)
    graph, nodes = fused(new, [*values, *tangents])
    n = len(forward.state)
    return Tangent(graph, tuple(nodes[:n]), tuple(nodes[n:]), forward.n_input)

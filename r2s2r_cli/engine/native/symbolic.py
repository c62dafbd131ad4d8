"""Tracing: torch code run on symbolic tensors, which record scalar operations instead of computing.

A symbolic tensor is a torch tensor without storage (a wrapper subclass); torch decomposes whatever is called on it to
aten operations, and those act on an array of graph nodes. Views of a symbolic tensor are views of that array, so
writing in place works as in torch.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from r2s2r_cli.engine.errors import EngineError
from r2s2r_cli.engine.native.graph import Graph, Subroutine

Nodes = npt.NDArray[np.int64]
Operation = Callable[..., Any]

StepFn = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(s (B, NS), u (B, NU), p (B, NP), h (B, 1)) -> s' (B, NS)."""

_FACTORIES = frozenset({"empty", "zeros", "ones", "full", "empty_strided"})


class TracingError(EngineError):
    """The code cannot be compiled: it uses an operation that the tracer does not know, or branches on values."""


@dataclass(frozen=True)
class Trace:
    """Where symbolic tensors record, and the floating-point type that they stand for. inner: of a guarded function."""

    graph: Graph
    dtype: torch.dtype
    inner: bool = False

    def tensor(self, nodes: Nodes) -> Symbolic:
        """A symbolic tensor of these nodes; truth values if the first node is one."""
        boolean = nodes.size > 0 and self.graph.boolean(int(nodes.flat[0]))
        return Symbolic(self, nodes, torch.bool if boolean else self.dtype)

    def nodes(self, x: Any) -> Nodes:
        """Nodes of a symbolic tensor, an ordinary tensor or a number; the latter two become constants."""
        if isinstance(x, Symbolic):
            if x.recorder is not self:
                raise TracingError("a guarded function reads a traced tensor that is not in its `inputs`")
            return x.nodes
        if isinstance(x, Tensor):
            value = self.graph.true if x.dtype == torch.bool else self.graph.const
            flat = [value(v) for v in x.detach().reshape(-1).tolist()]
            return np.array(flat, dtype=np.int64).reshape(tuple(x.shape))
        return np.array(self.graph.true(x) if isinstance(x, bool) else self.graph.const(x), dtype=np.int64)


class Symbolic(Tensor):
    """A tensor of graph nodes. recorder: where it records. nodes: int64 array of its shape."""

    recorder: Trace
    nodes: Nodes
    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]

    @staticmethod
    def __new__(cls, trace: Trace, nodes: Nodes, dtype: torch.dtype) -> Symbolic:  # noqa: D102
        self: Symbolic = Tensor._make_wrapper_subclass(cls, nodes.shape, dtype=dtype, device=torch.device("cpu"))
        self.recorder, self.nodes = trace, nodes
        return self

    def __init__(self, *_: Any) -> None:
        super().__init__()

    @classmethod
    def __torch_dispatch__(  # type: ignore[override]
        cls, func: Any, types: Any, args: Sequence[Any] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        trace = next(x.recorder for x in _flat(args) if isinstance(x, Symbolic))
        return _record(trace, func, args, kwargs or {})


class _Recording(TorchDispatchMode):
    """While tracing, new floating-point tensors are symbolic too, so that traced values can be written into them."""

    def __init__(self, trace: Trace) -> None:
        super().__init__()
        self._trace = trace

    @classmethod
    def _should_skip_dynamo(cls) -> bool:
        return False  # or torch loads its own compiler, for a second, only to keep it away from here

    def __torch_dispatch__(
        self, func: Any, types: Any, args: Sequence[Any] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        kwargs = kwargs or {}
        if any(isinstance(x, Symbolic) for x in _flat(args)):
            return _record(self._trace, func, args, kwargs)
        if torch.Tag.nondeterministic_seeded in func.tags and kwargs.get("generator") is None:
            raise TracingError(f"{_where()}: {func} cannot be compiled: it is drawn once, for all steps and runs")
        result = func(*args, **kwargs)
        if func.overloadpacket.__name__ in _FACTORIES and result.is_floating_point():
            return self._trace.tensor(self._trace.nodes(result))
        return result


def _flat(args: Any) -> list[Any]:
    """The arguments, lists among them opened."""
    return [y for x in args for y in (x if isinstance(x, list | tuple) else (x,))]


def _record(trace: Trace, func: Any, args: Sequence[Any], kwargs: dict[str, Any]) -> Any:
    """Run one aten operation on nodes. Operations in place write into the nodes of their first argument."""
    from r2s2r_cli.engine.native.operators import OPERATORS

    name = func.overloadpacket.__name__
    in_place = name not in OPERATORS and name.endswith("_") and name[:-1] in OPERATORS
    operation = OPERATORS.get(name[:-1] if in_place else name)
    if operation is None:
        if name in ("_local_scalar_dense", "is_nonzero", "item"):
            raise TracingError(f"{_where()}: Python needs the value of a traced tensor; use torch.where, or guarded()")
        raise TracingError(f"{_where()}: the operation {func} cannot be compiled")
    kwargs = {key: value for key, value in kwargs.items() if key not in ("device", "layout", "pin_memory")}
    dtype = kwargs.get("dtype") or trace.dtype
    if dtype not in (trace.dtype, torch.bool):
        raise TracingError(f"{_where()}: conversion to {dtype} cannot be compiled: the step computes in {trace.dtype}")
    try:
        result = operation(trace, *args, **kwargs)
    except TracingError as error:
        raise TracingError(f"{_where()}: {error}") from error
    except (TypeError, ValueError, IndexError) as error:
        raise TracingError(f"{_where()}: {func} cannot be compiled with these arguments: {error}") from error
    if in_place:
        if not isinstance(args[0], Symbolic):
            raise TracingError(f"{_where()}: {func} writes a traced value into an ordinary tensor; use torch.stack")
        if np.shape(result) != args[0].nodes.shape:
            raise TracingError(f"{_where()}: {func} changes a shape in place, which cannot be compiled")
        args[0].nodes[...] = result
        return args[0]
    if isinstance(result, list):
        return [trace.tensor(nodes) for nodes in result]
    return trace.tensor(result)


def _where() -> str:
    """File and line of the traced code: the innermost frame outside torch, roma and this package."""
    here, outside = Path(__file__).parent, (Path(torch.__file__).parent,)
    for frame in reversed(traceback.extract_stack()):
        path = Path(frame.filename)
        if here in path.parents or any(p in path.parents for p in outside) or "roma" in path.parts:
            continue
        return f"{path.name}:{frame.lineno}: `{frame.line}`"
    return "?"


def trace_step(fn: StepFn, n_state: int, n_input: int, n_param: int, dtype: torch.dtype) -> tuple[Graph, list[int]]:
    """Scalar program of one step of one environment: its graph, and the nodes of the next state.

    The graph's inputs are ("s", i), ("u", i), ("p", i) and ("h", 0). Raises TracingError.
    """
    graph = Graph()
    trace = Trace(graph, dtype)
    sizes = {"s": n_state, "u": n_input, "p": n_param, "h": 1}
    inputs = [trace.tensor(_inputs(graph, kind, n)[None]) for kind, n in sizes.items()]
    outputs = run(trace, lambda: fn(*inputs))
    nodes = trace.nodes(outputs)
    if nodes.shape != (1, n_state):
        raise TracingError(f"the step returned shape {tuple(nodes.shape)} for a state of shape (1, {n_state})")
    return graph, [int(i) for i in nodes[0]]


def _inputs(graph: Graph, kind: str, n: int) -> Nodes:
    return np.array([graph.node("in", kind, k) for k in range(n)], dtype=np.int64)


def run(trace: Trace, fn: Callable[[], Any]) -> Any:
    """Call `fn` while the trace records."""
    with torch.no_grad(), _Recording(trace):
        return fn()


def guarded_call(
    when: Tensor, fn: Callable[..., tuple[Tensor, ...]], inputs: tuple[Tensor, ...], otherwise: tuple[Tensor, ...]
) -> tuple[Tensor, ...]:
    """Record a call of `fn` as one node, its code as a subroutine; see engine/guarded.py."""
    from r2s2r_cli.engine.native.elementwise import real

    outer = next(x.recorder for x in (when, *inputs, *otherwise) if isinstance(x, Symbolic))
    g = outer.graph
    if outer.inner:
        raise TracingError(f"{_where()}: a guarded function cannot call another")
    given, kept = [outer.nodes(x) for x in inputs], [outer.nodes(x) for x in otherwise]
    inner = Trace(Graph(), outer.dtype, inner=True)
    flat = [real(g, i) for nodes in given for i in nodes.ravel().tolist()]
    places = iter(range(len(flat)))
    arguments = []
    for x, nodes in zip(inputs, given, strict=True):
        places_of = np.array([inner.graph.node("in", "x", next(places)) for _ in range(nodes.size)], dtype=np.int64)
        arguments.append((inner.tensor(places_of.reshape(nodes.shape)), x.dtype == torch.bool))
    # Truth values travel as numbers; compared inside, where the subroutine is recorded.
    results = [inner.nodes(x) for x in run(inner, lambda: fn(*(x > 0 if truth else x for x, truth in arguments)))]
    shapes = [[nodes.shape for nodes in group] for group in (results, kept)]
    if shapes[0] != shapes[1]:
        raise TracingError(f"{_where()}: the guarded function returns shapes {shapes[0]}, `otherwise` has {shapes[1]}")
    outputs = tuple(i for nodes in results for i in nodes.ravel().tolist())
    number = g.subroutine(Subroutine(inner.graph, outputs, len(flat)))
    flag = int(outer.nodes(when).reshape(-1)[0])
    called = g.call(number, flag, flat, [i for nodes in kept for i in nodes.ravel().tolist()])
    split = np.split(np.array(called, dtype=np.int64), np.cumsum([nodes.size for nodes in kept])[:-1])
    return tuple(outer.tensor(part.reshape(nodes.shape)) for part, nodes in zip(split, kept, strict=True))

"""The aten operations that only move elements: on arrays of nodes they are numpy's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from r2s2r_cli.engine.native.elementwise import real, truth
from r2s2r_cli.engine.native.symbolic import Nodes, Operation, Symbolic, Trace, TracingError


def _expand(trace: Trace, x: Any, size: Sequence[int], **_: Any) -> Nodes:
    nodes = trace.nodes(x)
    lead = len(size) - nodes.ndim
    shape = [nodes.shape[k - lead] if n == -1 else n for k, n in enumerate(size)]
    return np.broadcast_to(nodes, shape)


def _squeeze(trace: Trace, x: Any, dim: int | Sequence[int] | None = None) -> Nodes:
    nodes = trace.nodes(x)
    dims = range(nodes.ndim) if dim is None else (dim,) if isinstance(dim, int) else dim
    return nodes.squeeze(axis=tuple({k % nodes.ndim for k in dims if nodes.shape[k] == 1}) if nodes.ndim else ())


def _slice(
    trace: Trace, x: Any, dim: int = 0, start: int | None = None, end: int | None = None, step: int = 1
) -> Nodes:
    nodes = trace.nodes(x)
    index: list[Any] = [slice(None)] * nodes.ndim
    index[dim] = slice(start, end, step)
    return nodes[tuple(index)]


def _select(trace: Trace, x: Any, dim: int, index: int) -> Nodes:
    nodes = trace.nodes(x)
    where: list[Any] = [slice(None)] * nodes.ndim
    where[dim] = index
    # Two steps: an index that is complete would give a number instead of a view.
    return nodes[(*where[: dim % nodes.ndim], slice(index, index + 1 or None))].squeeze(axis=dim % nodes.ndim)


def _split(trace: Trace, x: Any, size: int | Sequence[int], dim: int = 0) -> list[Nodes]:
    nodes = trace.nodes(x)
    if isinstance(size, int):
        return np.split(nodes, range(size, nodes.shape[dim], size), axis=dim)
    return np.split(nodes, np.cumsum(size)[:-1], axis=dim)


def _unbind(trace: Trace, x: Any, dim: int = 0) -> list[Nodes]:
    return [_select(trace, x, dim, k) for k in range(trace.nodes(x).shape[dim])]


def _constant_index(index: Any) -> Any:
    """An index tensor as numpy array."""
    if isinstance(index, Symbolic):
        raise TracingError("an index that depends on traced values cannot be compiled; use torch.where")
    kind = bool if index.dtype == torch.bool else np.int64
    # The list of an empty tensor has lost its shape.
    return np.array(index.tolist(), dtype=kind).reshape(tuple(index.shape))


def _indices(index: Sequence[Any]) -> tuple[Any, ...]:
    return tuple(slice(None) if i is None else _constant_index(i) for i in index)


def _index_put(trace: Trace, x: Any, index: Sequence[Any], values: Any, accumulate: bool = False) -> Nodes:
    nodes = trace.nodes(x).copy()
    where = _indices(index)
    new = trace.nodes(values)
    if not accumulate:
        nodes[where] = new
        return nodes
    # Elements may be named more than once: number the places, then add one by one.
    places = np.arange(nodes.size).reshape(nodes.shape)[where]
    flat = nodes.reshape(-1)
    for place, value in zip(places.ravel().tolist(), np.broadcast_to(new, places.shape).ravel().tolist(), strict=True):
        flat[place] = trace.graph.add(int(flat[place]), value)
    return nodes


def _index_add(trace: Trace, x: Any, dim: int, index: Tensor, source: Any, *, alpha: float = 1) -> Nodes:
    g = trace.graph
    nodes, added = np.moveaxis(trace.nodes(x).copy(), dim, 0), np.moveaxis(trace.nodes(source), dim, 0)
    factor = g.const(alpha)
    for k, place in enumerate(_constant_index(index).tolist()):
        pairs = zip(nodes[place].ravel().tolist(), added[k].ravel().tolist(), strict=True)
        nodes[place] = np.reshape([g.add(a, g.mul(factor, b)) for a, b in pairs], nodes[place].shape)
    return np.moveaxis(nodes, 0, dim)


def _scatter_add(trace: Trace, x: Any, dim: int, index: Tensor, source: Any) -> Nodes:
    nodes, new, place = trace.nodes(x).copy(), trace.nodes(source), _constant_index(index)
    for at in np.ndindex(*place.shape):
        to = (*at[: dim % nodes.ndim], int(place[at]), *at[dim % nodes.ndim + 1 :])
        nodes[to] = trace.graph.add(int(nodes[to]), int(new[at]))
    return nodes


def _triangle(keep: Any) -> Operation:
    def triangle(trace: Trace, x: Any, diagonal: int = 0) -> Nodes:
        nodes = trace.nodes(x)
        return np.where(keep(np.ones(nodes.shape[-2:], dtype=bool), diagonal), nodes, trace.graph.const(0.0))

    return triangle


def _diag_embed(trace: Trace, x: Any, offset: int = 0, dim1: int = -2, dim2: int = -1) -> Nodes:
    nodes = trace.nodes(x)
    n = nodes.shape[-1] + abs(offset)
    matrix = np.full((*nodes.shape[:-1], n, n), trace.graph.const(0.0), dtype=np.int64)
    k = np.arange(nodes.shape[-1])
    matrix[..., k + max(-offset, 0), k + max(offset, 0)] = nodes
    return np.moveaxis(matrix, (-2, -1), (dim1, dim2))


def _diagonal(trace: Trace, x: Any, offset: int = 0, dim1: int = 0, dim2: int = 1) -> Nodes:
    return trace.nodes(x).diagonal(offset, dim1, dim2)


def _pad(trace: Trace, x: Any, pad: Sequence[int], value: float = 0) -> Nodes:
    nodes = trace.nodes(x)
    widths = [(0, 0)] * (nodes.ndim - len(pad) // 2)
    widths += [(pad[k], pad[k + 1]) for k in range(len(pad) - 2, -1, -2)]
    return np.pad(nodes, widths, constant_values=trace.graph.const(value))


def _roll(trace: Trace, x: Any, shifts: Sequence[int], dims: Sequence[int] = ()) -> Nodes:
    return np.roll(trace.nodes(x), tuple(shifts) if dims else shifts[0], tuple(dims) if dims else None)


def _to(trace: Trace, x: Any, *, dtype: torch.dtype | None = None, **_: Any) -> Nodes:
    nodes = trace.nodes(x).copy()
    cast = truth if dtype == torch.bool else real
    return np.array([cast(trace.graph, i) for i in nodes.ravel().tolist()], dtype=np.int64).reshape(nodes.shape)


def _full(trace: Trace, shape: Sequence[int], value: Any, dtype: torch.dtype | None) -> Nodes:
    node = trace.graph.true(bool(value)) if dtype == torch.bool else trace.graph.const(float(value))
    return np.full(tuple(shape), node, dtype=np.int64)


def _like(value: float) -> Operation:
    def like(trace: Trace, x: Any, *, dtype: torch.dtype | None = None, **_: Any) -> Nodes:
        return _full(trace, x.shape, value, dtype or x.dtype)

    return like


def _new(value: float) -> Operation:
    def new(trace: Trace, x: Any, size: Sequence[int], *, dtype: torch.dtype | None = None, **_: Any) -> Nodes:
        return _full(trace, size, value, dtype or x.dtype)

    return new


def _fill(trace: Trace, x: Any, value: Any) -> Nodes:
    return np.broadcast_to(trace.nodes(value), x.shape).copy()


def _copy(trace: Trace, x: Any, source: Any, *_: Any) -> Nodes:
    return np.broadcast_to(trace.nodes(source), x.shape).copy()


def _joined(join: Any) -> Operation:
    return lambda trace, tensors, dim=0: join([trace.nodes(x) for x in tensors], axis=dim)


def _view(trace: Trace, x: Any, size: Sequence[int]) -> Nodes:
    return trace.nodes(x).reshape(tuple(size))


def _same(trace: Trace, x: Any, *_: Any, **__: Any) -> Nodes:
    return trace.nodes(x).copy()


SHAPING: dict[str, Operation] = {
    "view": _view,
    "_unsafe_view": _view,
    "expand": _expand,
    "permute": lambda trace, x, dims: trace.nodes(x).transpose(*dims),
    "transpose": lambda trace, x, a, b: trace.nodes(x).swapaxes(a, b),
    "t": lambda trace, x: trace.nodes(x).T,
    "unsqueeze": lambda trace, x, dim: np.expand_dims(trace.nodes(x), dim),
    "squeeze": _squeeze,
    "slice": _slice,
    "select": _select,
    "split": _split,
    "split_with_sizes": _split,
    "unbind": _unbind,
    "cat": _joined(np.concatenate),
    "stack": _joined(np.stack),
    "index": lambda trace, x, index: trace.nodes(x)[_indices(index)],
    "index_select": lambda trace, x, dim, index: np.take(trace.nodes(x), _constant_index(index), axis=dim),
    "gather": lambda trace, x, dim, index, **_: np.take_along_axis(trace.nodes(x), _constant_index(index), dim),
    "index_put": _index_put,
    "index_add": _index_add,
    "scatter_add": _scatter_add,
    "flip": lambda trace, x, dims: np.flip(trace.nodes(x), tuple(dims)),
    "roll": _roll,
    "tril": _triangle(np.tril),
    "triu": _triangle(np.triu),
    "repeat": lambda trace, x, repeats: np.tile(trace.nodes(x), tuple(repeats)),
    "diag_embed": _diag_embed,
    "diagonal": _diagonal,
    "constant_pad_nd": _pad,
    "clone": _same,
    "alias": lambda trace, x: trace.nodes(x),
    "_to_copy": _to,
    "zeros_like": _like(0.0),
    "ones_like": _like(1.0),
    "empty_like": _like(0.0),
    "full_like": lambda trace, x, value, dtype=None, **_: _full(trace, x.shape, value, dtype or x.dtype),
    "new_zeros": _new(0.0),
    "new_ones": _new(1.0),
    "new_empty": _new(0.0),
    "new_full": lambda trace, x, size, value, dtype=None, **_: _full(trace, size, value, dtype or x.dtype),
    "fill": _fill,
    "zero": lambda trace, x: _full(trace, x.shape, 0.0, x.dtype),
    "copy": _copy,
}
"""Traced form of every aten operation that moves elements."""

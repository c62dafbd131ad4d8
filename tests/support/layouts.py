"""Artifacts of any layout: random values of a spec, and whether two artifacts hold the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Scalar, Value
from schemas.base import DIM_SIZES, ArtifactSpec, DatasetSpec, GroupSpec


def materialised(data: ArtifactData) -> dict[str, dict[str, Any]]:
    """Everything an artifact holds, as comparable values: streamed frames as lists of bytes, arrays as arrays."""
    return {
        path: {
            "attributes": dict(group.attributes),
            **{n: list(v.items) if isinstance(v, Blobs) else v for n, v in group.datasets.items()},
        }
        for path, group in data.groups.items()
    }


def same(one: ArtifactData, two: ArtifactData) -> bool:
    """Whether two artifacts hold the same, bit by bit (NaN equals NaN, dtypes count)."""
    a, b = materialised(one), materialised(two)
    if one.kind != two.kind or a.keys() != b.keys() or any(a[p].keys() != b[p].keys() for p in a):
        return False
    return all(_equal(a[path][name], b[path][name]) for path in a for name in a[path])


def filled(
    spec: ArtifactSpec, sizes: Callable[[str], int], rng: np.random.Generator, *, keep: Callable[[str], bool]
) -> ArtifactData:
    """Random values in the layout of `spec`, one run (or policy) called `x`.

    sizes: length of an axis by name; the same for one name. keep: whether an optional dataset, attribute or group of
    this path is there. NaN stands wherever the layout gives it a meaning, in a tenth of the places.
    """
    groups: dict[str, Group] = {}
    for group in spec.groups:
        path = "/".join("x" if part.startswith("{") else part for part in group.path.split("/"))
        if group.required or keep(path):
            groups[path] = _fill(group, path, sizes, rng, keep)
    return ArtifactData(spec.kind, groups)


def _fill(
    group: GroupSpec, path: str, sizes: Callable[[str], int], rng: np.random.Generator, keep: Callable[[str], bool]
) -> Group:
    datasets = {d.path: _random(d, sizes, rng) for d in group.datasets if d.required or keep(f"{path}/{d.path}")}
    attributes: dict[str, Scalar] = {}
    for a in group.attributes:
        if a.required or keep(f"{path}@{a.name}"):
            values: Mapping[str, Scalar] = {"str": "worte ü", "int": int(rng.integers(-9, 9)),
                                            "float": float(rng.normal()), "bool": bool(rng.integers(2))}  # fmt: skip
            attributes[a.name] = a.choices[0] if a.choices else values[a.type]
    return Group(datasets, attributes)


def _random(spec: DatasetSpec, sizes: Callable[[str], int], rng: np.random.Generator) -> Value:
    shape = tuple(DIM_SIZES[d] if d in DIM_SIZES else sizes(d) for d in spec.dims)
    if spec.dtype == "blobs":
        return Blobs([rng.bytes(int(rng.integers(0, 40))) for _ in range(shape[0])], shape[0])
    if spec.dtype == "str":
        words = np.array(["", "a", "größer", "日本"], dtype="U")
        return np.char.encode(rng.choice(words, shape), "utf-8")
    if spec.dtype.startswith("float"):
        array = rng.normal(size=shape).astype(spec.dtype)
        if spec.nan_means:
            array[rng.random(shape) < 0.1] = np.nan
        return array
    if spec.dtype == "bool":
        return rng.integers(0, 2, shape).astype(bool)
    codes = list(spec.codes) or [0, 1, 2, 100]
    return rng.choice(np.array(codes), shape).astype(spec.dtype)


def _equal(one: Any, two: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(two, np.ndarray):
        if one.dtype.kind == "S" == two.dtype.kind:  # the width of text is not content
            return one.shape == two.shape and one.tolist() == two.tolist()
        return one.dtype == two.dtype and np.array_equal(one, two, equal_nan=one.dtype.kind == "f")
    return type(one) is type(two) and bool(one == two)

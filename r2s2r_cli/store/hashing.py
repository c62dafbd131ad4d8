"""Digests of what an artifact holds, computed from the open HDF5 file block by block."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import h5py
import numpy as np

from r2s2r_cli.store.canonical import canonical_json, json_sha256

PROVENANCE = "provenance"
HASH_ATTRIBUTES = ("content_sha256", "seal_sha256")
_IDENTITY = ("unit", "dims", "frame")
_BLOCK_BYTES = 1 << 22


@dataclass(frozen=True)
class Digests:
    """Digests of an artifact's content."""

    datasets: dict[str, str]
    """By path, without /provenance: dtype, shape, unit, dims, frame and bytes of each."""
    content: str
    """Over all of `datasets`, the group attributes, the kind and the version."""
    seal: str
    """Over the rest that can be read: descriptions, root attributes, provenance."""


def digest_file(file: h5py.File) -> Digests:
    """Compute the digests of an open artifact. Raises what h5py raises on damaged data."""
    datasets: dict[str, str] = {}
    rest: dict[str, object] = {}
    groups: dict[str, object] = {}
    for path, node in sorted(walk(file)):
        if path == PROVENANCE or path.startswith(PROVENANCE + "/"):
            rest[path] = _dataset_digest(node) if isinstance(node, h5py.Dataset) else attributes(node)
        elif isinstance(node, h5py.Dataset):
            datasets[path] = _dataset_digest(node)
            rest[path] = {k: v for k, v in attributes(node).items() if k not in _IDENTITY}
        else:
            groups[path] = attributes(node)
    root = {k: v for k, v in attributes(file).items() if k not in HASH_ATTRIBUTES}
    identity = {k: root.pop(k, None) for k in ("kind", "schema_version")}
    content = json_sha256({"identity": identity, "datasets": datasets, "groups": groups})
    return Digests(datasets, content, json_sha256({"content": content, "root": root, "rest": rest}))


def walk(file: h5py.File) -> Iterator[tuple[str, h5py.Dataset | h5py.Group]]:
    """Every group and dataset below the root, by path; links are not followed out of the tree."""
    stack: list[tuple[str, h5py.Group]] = [("", file)]
    while stack:
        prefix, group = stack.pop()
        for name in group:
            path = f"{prefix}/{name}" if prefix else name
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise ValueError(f"{path} is a link, artifacts have none")
            node = group[name]
            yield path, node
            if isinstance(node, h5py.Group):
                stack.append((path, node))


def attributes(node: h5py.Group | h5py.Dataset) -> dict[str, str | int | float | bool]:
    """The scalar attributes of a node as plain Python values."""
    return {name: plain(value) for name, value in node.attrs.items()}


def plain(value: object) -> str | int | float | bool:
    """One HDF5 scalar as str, int, float or bool."""
    if isinstance(value, bytes | np.bytes_):
        return bytes(value).decode("utf-8")
    if isinstance(value, str):
        return str(value)
    if isinstance(value, np.bool_ | np.integer | np.floating):
        return value.item()  # type: ignore[no-any-return]
    raise ValueError(f"not a scalar of a known type: {value!r}")


def _dataset_digest(dataset: h5py.Dataset) -> str:
    if dataset.dtype.hasobject:
        raise ValueError(f"{dataset.name} has the dtype {dataset.dtype}, artifacts have no object dtypes")
    digest = hashlib.sha256()
    identity = {k: v for k, v in attributes(dataset).items() if k in _IDENTITY}
    digest.update(canonical_json([dataset.dtype.str, list(dataset.shape), identity]).encode())
    for block in blocks(dataset):
        digest.update(np.ascontiguousarray(block).data)
    return digest.hexdigest()


def blocks(dataset: h5py.Dataset) -> Iterator[np.ndarray]:
    """The dataset in pieces of about 4 MB along its first axis, so that memory stays bounded."""
    if dataset.ndim == 0:
        yield np.asarray(dataset[()]).reshape(1)
        return
    row_bytes = max(1, int(np.prod(dataset.shape[1:], dtype=np.int64)) * dataset.dtype.itemsize)
    step = max(1, _BLOCK_BYTES // row_bytes)
    for start in range(0, dataset.shape[0], step):
        yield dataset[start : start + step]

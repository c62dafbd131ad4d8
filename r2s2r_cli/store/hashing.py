"""Digests of what an artifact holds, computed from the open HDF5 file block by block."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

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


Scalars = dict[str, str | int | float | bool]
"""Attributes of a node, by name."""


@dataclass(frozen=True)
class Node:
    """A group or dataset below the root, with its attributes, which take longer to read than small data."""

    path: str
    node: Any
    attributes: Scalars


def nodes_of(file: h5py.File) -> list[Node]:
    """Every node of an open artifact, by path. Raises what h5py raises on damage; ForeignContent."""
    return [Node(path, node, attributes(node)) for path, node in sorted(walk(file))]


def digest_file(file: h5py.File, nodes: list[Node] | None = None) -> Digests:
    """Compute the digests of an open artifact. nodes: of this file, where they were read already. Raises what h5py
    raises on damaged data."""
    datasets: dict[str, str] = {}
    rest: dict[str, object] = {}
    groups: dict[str, object] = {}
    for one in nodes_of(file) if nodes is None else nodes:
        path, is_dataset = one.path, isinstance(one.node, h5py.Dataset)
        if path == PROVENANCE or path.startswith(PROVENANCE + "/"):
            rest[path] = dataset_digest(one.node, one.attributes) if is_dataset else one.attributes
        elif is_dataset:
            datasets[path] = dataset_digest(one.node, one.attributes)
            rest[path] = {k: v for k, v in one.attributes.items() if k not in _IDENTITY}
        else:
            groups[path] = one.attributes
    root = {k: v for k, v in attributes(file).items() if k not in HASH_ATTRIBUTES}
    identity = {k: root.pop(k, None) for k in ("kind", "schema_version")}
    content = json_sha256({"identity": identity, "datasets": datasets, "groups": groups})
    return Digests(datasets, content, json_sha256({"content": content, "root": root, "rest": rest}))


class ForeignContent(ValueError):
    """Something that no artifact holds (a link, an object dtype, an array as attribute), in words."""


Broken = list[tuple[str, Exception]]
"""Path of a node that the library could not open, and what it said."""


def walk(file: h5py.File, *, strict: bool = True, broken: Broken | None = None) -> Iterator[tuple[str, Any]]:
    """Every group and dataset below the root, by path.

    Raises ForeignContent for a link and for a node met twice. With `strict=False` these are yielded as text.
    Nodes that cannot be opened go into `broken` where it is given, else the library's exception is raised.
    """
    stack: list[tuple[str, h5py.Group]] = [("", file)]
    met: set[int | None] = {_address(file)}
    while stack:
        prefix, group = stack.pop()
        try:
            names = list(group)
        except Exception as error:
            _keep(broken, prefix or "/", error)
            continue
        for name in names:
            readable = name if isinstance(name, str) else bytes(name).decode("utf-8", "replace")
            path = f"{prefix}/{readable}" if prefix else readable
            if readable is not name:
                if strict:
                    raise ForeignContent(f"the name {path} is not UTF-8 text, artifacts have no such")
                yield path, "a name that is not UTF-8 text"
                continue
            try:
                link = group.get(name, getlink=True)
                node = group[name] if isinstance(link, h5py.HardLink) else None
                address = None if node is None else _address(node)
            except Exception as error:
                _keep(broken, path, error)
                continue
            if node is None:
                if strict:
                    raise ForeignContent(f"{path} is a link, artifacts have none")
                yield path, f"link to {getattr(link, 'path', '?')}"
                continue
            if address in met:  # a ring of hard links would never end
                if strict:
                    raise ForeignContent(f"{path} is a second name of another node, artifacts have none")
                yield path, f"another name of {node.name}"
                continue
            met.add(address)
            yield path, node
            if isinstance(node, h5py.Group):
                stack.append((path, node))


def _keep(broken: Broken | None, path: str, error: Exception) -> None:
    if broken is None:
        raise error
    broken.append((path, error))


def attributes(node: h5py.Group | h5py.Dataset) -> Scalars:
    """The scalar attributes of a node as plain Python values."""
    return {name: plain(value) for name, value in node.attrs.items()}


def _address(node: h5py.Group | h5py.Dataset) -> int:
    return int(h5py.h5o.get_info(node.id).addr)


def plain(value: object) -> str | int | float | bool:
    """One HDF5 scalar as str, int, float or bool."""
    if isinstance(value, bytes | np.bytes_):
        return bytes(value).decode("utf-8")
    if isinstance(value, str):
        return str(value)
    if isinstance(value, np.floating) and not np.isfinite(value):
        raise ForeignContent(f"an attribute is {value}, artifacts have finite ones only")
    if isinstance(value, np.bool_ | np.integer | np.floating):
        return value.item()
    raise ForeignContent(f"an attribute is of the type {type(value).__name__}, artifacts have single values only")


def dataset_digest(dataset: h5py.Dataset, known: Scalars | None = None) -> str:
    """Digest of dtype, shape, unit, dims, frame and data. known: its attributes, where they were read already. Raises
    what h5py raises on damage; ForeignContent."""
    check_dataset(dataset)
    digest = hashlib.sha256()
    identity = {k: v for k, v in (attributes(dataset) if known is None else known).items() if k in _IDENTITY}
    digest.update(canonical_json([dataset.dtype.str, list(dataset.shape), identity]).encode())
    for block in blocks(dataset):
        digest.update(np.ascontiguousarray(block).data)
    return digest.hexdigest()


def check_dataset(dataset: h5py.Dataset) -> None:
    """Raises ForeignContent for a dataset of a form that no artifact has; reading it could run into anything."""
    if dataset.dtype.hasobject:
        raise ForeignContent(f"the dtype is {dataset.dtype}, artifacts have numbers and fixed-length text only")
    if dataset.shape is None:
        raise ForeignContent("the dataset is null, artifacts have none such")
    if dataset.external or dataset.is_virtual:
        raise ForeignContent("the data lie in other files, artifacts hold their own")


def blocks(dataset: h5py.Dataset) -> Iterator[np.ndarray]:
    """The dataset in pieces of about 4 MB along its first axis, so that memory stays bounded."""
    if dataset.ndim == 0:
        yield np.asarray(dataset[()]).reshape(1)
        return
    row_bytes = max(1, int(np.prod(dataset.shape[1:], dtype=np.int64)) * dataset.dtype.itemsize)
    step = max(1, _BLOCK_BYTES // row_bytes)
    for start in range(0, dataset.shape[0], step):
        yield dataset[start : start + step]

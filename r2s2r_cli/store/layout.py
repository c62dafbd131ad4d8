"""Does a file have the layout that its schema fixes? One answer for the writer and for `validate`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import h5py

from r2s2r_cli.store.hashing import PROVENANCE, Node, nodes_of
from schemas.base import DIM_SIZES, ArtifactSpec, DatasetSpec, GroupSpec

BLOB_BYTES, BLOB_OFFSET = "bytes", "offset"
_NUMPY_NAME = {"bool": "bool", "str": "S"}
_PYTHON_TYPE: dict[str, tuple[type, ...]] = {"str": (str,), "int": (int,), "float": (float,), "bool": (bool,)}


Nodes = dict[str, Node]
Sizes = dict[tuple[str, str], tuple[int, str]]
"""(scope, axis) -> its length and the dataset that it was first met in."""


@dataclass(frozen=True)
class Mismatch:
    """One place where a file departs from its schema."""

    where: str
    """HDF5 path, with `@name` for an attribute."""
    what: str
    expected: str
    received: str
    hint: str = ""
    """Where it needs another remedy than the check that found it."""


def check_layout(file: h5py.File, spec: ArtifactSpec, nodes: list[Node] | None = None) -> list[Mismatch]:
    """Compare an open file with the layout of its kind: presence, dtype, dims, unit, frame, attributes. nodes: of this
    file, where they were read already."""
    groups: Nodes = {}
    datasets: Nodes = {}
    for one in nodes_of(file) if nodes is None else nodes:
        if one.path != PROVENANCE and not one.path.startswith(PROVENANCE + "/"):
            (groups if isinstance(one.node, h5py.Group) else datasets)[one.path] = one
    return [*_unknown(groups, datasets, spec), *_missing_groups(groups, spec), *_check_groups(groups, datasets, spec)]


def owner(path: str, spec: ArtifactSpec) -> tuple[str, GroupSpec, DatasetSpec | None] | None:
    """The group (its path and spec) that a path belongs to, and the dataset spec where it is a dataset."""
    parts = path.split("/")
    for cut in range(len(parts), 0, -1):
        group = spec.group("/".join(parts[:cut]))
        if group is None:
            continue
        relative = "/".join(parts[cut:])
        if not relative:
            return path, group, None
        for candidate, tail in ((relative, ""), (relative.rpartition("/")[0], relative.rpartition("/")[2])):
            dataset = group.dataset(candidate) if candidate else None
            if dataset and (tail in ("", BLOB_BYTES, BLOB_OFFSET)) and (dataset.dtype == "blobs" or not tail):
                return "/".join(parts[:cut]), group, dataset
        return None
    return None


def is_container(path: str, spec: ArtifactSpec) -> bool:
    """Whether a group is only a step on the way to the groups of the schema (`runs`, `sets`)."""
    depth = path.count("/") + 1
    prefixes = ("/".join(g.path.split("/")[:depth]) for g in spec.groups if g.path.count("/") >= depth)
    return any(GroupSpec(path=prefix, description="").matches(path) for prefix in prefixes)


def scope(path: str, group: GroupSpec) -> str:
    """Axes have one length within this part of the file: a run, a policy, or else the group at this path."""
    return "/".join(path.split("/")[:2]) if "{" in group.path else path


def _unknown(groups: Nodes, datasets: Nodes, spec: ArtifactSpec) -> Iterator[Mismatch]:
    for path in sorted({**groups, **datasets}):
        found = owner(path, spec)
        if path in datasets and (found is None or found[2] is None):
            yield Mismatch(path, "the schema knows no such dataset", f"a dataset of {spec.kind}", "an unknown one")
        elif path in groups and found is None and not is_container(path, spec):
            yield Mismatch(path, "the schema knows no such group", f"a group of {spec.kind}", "an unknown one")


def _missing_groups(groups: Nodes, spec: ArtifactSpec) -> Iterator[Mismatch]:
    for group in spec.groups:
        if not group.required:
            continue
        head, _, tail = group.path.partition("}/")
        if not tail:
            if not any(group.matches(path) for path in groups):
                yield Mismatch(group.path, "a required group is missing", group.description, "nothing")
            continue
        each = GroupSpec(path=head + "}", description="")  # in every run
        for path in sorted(p for p in groups if each.matches(p)):
            if f"{path}/{tail}" not in groups:
                yield Mismatch(f"{path}/{tail}", "a required group is missing", group.description, "nothing")


def _check_groups(groups: Nodes, datasets: Nodes, spec: ArtifactSpec) -> Iterator[Mismatch]:
    sizes: Sizes = {}
    for path, node in sorted(groups.items()):
        group = spec.group(path)
        if group is None:
            continue
        yield from _check_attributes(path, node, group)
        for dataset in group.datasets:
            parts = on_disk(dataset)
            required = dataset.required or any(f"{path}/{name}" in datasets for name, _ in parts)  # never half of it
            for name, expected in parts:
                full = f"{path}/{name}"
                if full in datasets:
                    yield from _check_dataset(full, datasets[full], expected, scope(path, group), sizes)
                elif required:
                    yield Mismatch(
                        full, "a required dataset is missing", f"{expected.dtype} {expected.dims}", "nothing"
                    )


def on_disk(dataset: DatasetSpec) -> list[tuple[str, DatasetSpec]]:
    """The HDF5 datasets that hold one specified dataset, by path relative to the group."""
    if dataset.dtype != "blobs":
        return [(dataset.path, dataset)]
    data = dataset.model_copy(update={"dtype": "uint8", "dims": ("byte",), "unit": "byte"})
    offset = dataset.model_copy(update={"dtype": "uint64", "dims": (f"{dataset.dims[0]}+1",), "unit": "index"})
    return [(f"{dataset.path}/{BLOB_BYTES}", data), (f"{dataset.path}/{BLOB_OFFSET}", offset)]


def _check_attributes(path: str, node: Node, group: GroupSpec) -> Iterator[Mismatch]:
    found = node.attributes
    for attribute in group.attributes:
        where = f"{path}@{attribute.name}"
        if attribute.name not in found:
            if attribute.required:
                yield Mismatch(where, "a required attribute is missing", attribute.type, "nothing")
            continue
        value = found[attribute.name]
        right = _PYTHON_TYPE[attribute.type]
        if not isinstance(value, right) or (isinstance(value, bool) and attribute.type != "bool"):
            yield Mismatch(where, "an attribute has the wrong type", attribute.type, type(value).__name__)
        elif attribute.choices and value not in attribute.choices:
            yield Mismatch(where, "an attribute has an unknown value", " | ".join(attribute.choices), str(value))
    known = {attribute.name for attribute in group.attributes}
    for name in sorted(set(found) - known):
        yield Mismatch(f"{path}@{name}", "the schema knows no such attribute", "one of the schema", "an unknown one")


def _check_dataset(path: str, one: Node, spec: DatasetSpec, scope: str, sizes: Sizes) -> Iterator[Mismatch]:
    node: h5py.Dataset = one.node
    received = "S" if node.dtype.kind == "S" else node.dtype.name
    if received != _NUMPY_NAME.get(spec.dtype, spec.dtype):
        yield Mismatch(path, "a dataset has the wrong dtype", spec.dtype, received)
    if node.ndim != len(spec.dims):
        yield Mismatch(path, "a dataset has the wrong number of axes", str(spec.dims), f"shape {node.shape}")
    else:
        for name, size in zip(spec.dims, node.shape, strict=True):
            yield from _check_axis(path, name, size, scope, sizes)
    found = one.attributes
    for name, expected in (("unit", spec.unit), ("dims", ",".join(spec.dims)), ("frame", spec.frame)):
        if found.get(name) != expected:
            text = str(found.get(name, "nothing")) or "an empty text"
            yield Mismatch(f"{path}@{name}", f"a dataset has the wrong {name}", expected or "none", text)


def _check_axis(path: str, name: str, size: int, scope: str, sizes: Sizes) -> Iterator[Mismatch]:
    if name == "byte":
        return
    if name in DIM_SIZES:
        if size != DIM_SIZES[name]:
            yield Mismatch(path, f"axis {name} has the wrong length", str(DIM_SIZES[name]), str(size))
        return
    base, plus = (name[:-2], 1) if name.endswith("+1") else (name, 0)
    first, where = sizes.setdefault((scope, base), (size - plus, path))
    if size - plus != first:
        yield Mismatch(path, f"axis {base} has another length than in {where}", str(first), str(size - plus))

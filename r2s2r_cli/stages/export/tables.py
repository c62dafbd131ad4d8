"""An artifact as CSV tables: one file a group, units in the column names."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from schemas.base import ArtifactSpec, DatasetSpec, GroupSpec

_NO_UNIT = ("1", "index", "code", "bool", "count")
_COMPONENTS = {"xyz": "xyz", "xyz2": "xyz", "quat": "xyzw", "pair": "01", "mat4": "0123"}
"""Axes that are no rows of a table but parts of one value, and the names of these parts."""
_IMAGE_ENDING = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg"}
"""By the first bytes. What follows those of a JPEG says who wrote it: JFIF, EXIF, a comment, a colour profile."""


def csv_files(data: ArtifactData, spec: ArtifactSpec, stem: str) -> Iterator[tuple[str, bytes]]:
    """Every group as CSV, its attributes as one JSON, its encoded frames as image files.

    Names: `<stem>/<group path>.csv` for the rows of a group (a frame, a command, an interval ...),
    `<group path>_by_<axis>.csv` for values that it holds by something else (`caps_by_rod.csv`), and
    `<group path>_constant.csv` for single vectors beside rows. Numbers are written with all their digits.
    """
    return ((name, content()) for name, content in _files(data, spec, stem))


def csv_names(data: ArtifactData, spec: ArtifactSpec, stem: str) -> list[str]:
    """The names alone, in the same order: no table is written for them."""
    return [name for name, _ in _files(data, spec, stem)]


def _files(data: ArtifactData, spec: ArtifactSpec, stem: str) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """The name of each file, and what makes its content."""
    attributes: dict[str, object] = {}
    for path, group in data.groups.items():
        layout = spec.group(path)
        if layout is None:
            continue
        if group.attributes:
            attributes[path] = dict(group.attributes)
        tables = _by_rows(group, layout)
        for place, (axis, names) in enumerate(tables.items()):
            yield f"{stem}/{path}{_ending(axis) if place else ''}.csv", partial(_table, group, layout, names)
        yield from _frames(group, f"{stem}/{path}")
    yield f"{stem}/attributes.json", (json.dumps(attributes, indent=2, ensure_ascii=False) + "\n").encode


def npz_file(data: ArtifactData, stem: str, header_json: str) -> tuple[str, bytes]:
    """All arrays under their paths, plus `attributes` and `header` as JSON text; encoded frames are left out."""
    arrays: dict[str, np.ndarray] = {}
    attributes = {path: dict(group.attributes) for path, group in data.groups.items() if group.attributes}
    for path, group in data.groups.items():
        arrays |= {f"{path}/{name}": v for name, v in group.datasets.items() if isinstance(v, np.ndarray)}
    arrays["attributes"] = np.array(json.dumps(attributes))
    arrays["header"] = np.array(header_json)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return f"{stem}.npz", buffer.getvalue()


def column_names(dataset: DatasetSpec, shape: tuple[int, ...]) -> list[str]:
    """Names of the columns of one dataset: `p_WE_cap3_x_m`, `q_WR_rod0_w`. shape: rows first, or of a single value."""
    unit = "" if dataset.unit in _NO_UNIT else dataset.unit.lower()
    ending = "_" + unit.replace("1/", "per_").replace("/", "_per_").replace("^", "").replace(" ", "_") if unit else ""
    names = [dataset.path]
    single = dataset.dims[0] in _COMPONENTS
    for axis, size in list(zip(dataset.dims, shape, strict=True))[0 if single else 1 :]:
        labels = _COMPONENTS[axis] if axis in _COMPONENTS else [f"{axis}{i}" for i in range(size)]
        names = [f"{name}_{label}" for name in names for label in labels]
    return [name + ending for name in names]


def _by_rows(group: Group, layout: GroupSpec) -> dict[str, list[str]]:
    """Names of the datasets by the axis of their rows, the group's own axis first; '' for single values."""
    tables: dict[str, list[str]] = {}
    for dataset in layout.datasets:
        value = group.datasets.get(dataset.path)
        if isinstance(value, np.ndarray) and value.ndim:
            axis = "" if dataset.dims[0] in _COMPONENTS else dataset.dims[0]
            tables.setdefault(axis, []).append(dataset.path)
    return tables


def _ending(axis: str) -> str:
    return f"_by_{axis.removeprefix('t_')}" if axis else "_constant"


def _table(group: Group, layout: GroupSpec, names: list[str]) -> bytes:
    header: list[str] = []
    columns: list[np.ndarray] = []
    for name in names:
        dataset, value = layout.dataset(name), group[name]
        if dataset is None:
            continue
        header += column_names(dataset, value.shape)
        rows = 1 if dataset.dims[0] in _COMPONENTS else len(value)
        columns += list(value.reshape(rows, -1).T) if value.size else []
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in zip(*columns, strict=True):
        writer.writerow([_cell(value) for value in row])
    return text.getvalue().encode()


def _cell(value: object) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.bool_):
        return str(int(value))
    return repr(value.item()) if isinstance(value, np.generic) else str(value)


def _frames(group: Group, folder: str) -> Iterator[tuple[str, Callable[[], bytes]]]:
    for name, value in group.datasets.items():
        if isinstance(value, Blobs):
            for i, image in enumerate(value.items):
                ending = next((one for first, one in _IMAGE_ENDING.items() if image.startswith(first)), "bin")
                yield f"{folder}/{name}/{i:06d}.{ending}", partial(bytes, image)

"""An artifact as CSV tables: one file for each group and first axis, units in the column names."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from schemas.base import ArtifactSpec, DatasetSpec, GroupSpec

_SHORT = {"m/s": "m_per_s", "rad/s": "rad_per_s", "m/s^2": "m_per_s2", "N/m": "n_per_m", "kg m^2": "kg_m2", "1": ""}
_XYZ = "xyz"
_IMAGE_ENDING = {b"\x89PNG": "png", b"\xff\xd8\xff\xe0": "jpg", b"\xff\xd8\xff\xe1": "jpg", b"\xff\xd8\xff\xdb": "jpg"}


def csv_files(data: ArtifactData, spec: ArtifactSpec, stem: str) -> Iterator[tuple[str, bytes]]:
    """Every group as CSV, its attributes as one JSON, its encoded frames as image files.

    Names: `<stem>/<group path>/<first axis>.csv`. Numbers are written with all their digits.
    """
    attributes: dict[str, object] = {}
    for path, group in data.groups.items():
        layout = spec.group(path)
        if layout is None:
            continue
        if group.attributes:
            attributes[path] = dict(group.attributes)
        for axis, names in _by_first_axis(group, layout).items():
            yield f"{stem}/{path}/{axis}.csv", _table(group, layout, names)
        yield from _frames(group, f"{stem}/{path}")
    yield f"{stem}/attributes.json", (json.dumps(attributes, indent=2, ensure_ascii=False) + "\n").encode()


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
    """Names of the columns of one dataset, the first axis being the rows: `p_WE_cap0_x_m`."""
    unit = _SHORT.get(dataset.unit, dataset.unit).lower()
    ending = f"_{unit}" if unit and unit not in ("index", "code", "bool", "count") else ""
    names = [dataset.path]
    for axis, size in zip(dataset.dims[1:], shape[1:], strict=True):
        labels = list(_XYZ) if axis.startswith(_XYZ) else [f"{axis}{i}" for i in range(size)]
        names = [f"{name}_{label}" for name in names for label in labels]
    return [name + ending for name in names]


def _by_first_axis(group: Group, layout: GroupSpec) -> dict[str, list[str]]:
    tables: dict[str, list[str]] = {}
    for dataset in layout.datasets:
        value = group.datasets.get(dataset.path)
        if isinstance(value, np.ndarray) and value.ndim:
            tables.setdefault(dataset.dims[0], []).append(dataset.path)
    return tables


def _table(group: Group, layout: GroupSpec, names: list[str]) -> bytes:
    header: list[str] = []
    columns: list[np.ndarray] = []
    for name in names:
        dataset, value = layout.dataset(name), group[name]
        if dataset is None:
            continue
        header += column_names(dataset, value.shape)
        columns += list(value.reshape(len(value), -1).T) if value.size else []
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


def _frames(group: Group, folder: str) -> Iterator[tuple[str, bytes]]:
    for name, value in group.datasets.items():
        if isinstance(value, Blobs):
            for i, image in enumerate(value.items):
                yield f"{folder}/{name}/{i:06d}.{_IMAGE_ENDING.get(image[:4], 'bin')}", image

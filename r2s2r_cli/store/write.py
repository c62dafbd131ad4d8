"""Write an artifact once: whole, verified and sealed, or not at all."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Rows, Scalar, Value
from r2s2r_cli.store.atomic import replacing
from r2s2r_cli.store.hashing import PROVENANCE, digest_file, nodes_of
from r2s2r_cli.store.hdf5_file import writable
from r2s2r_cli.store.header import MAX_BLOCK, block, block_size, body_sha256, read_header, write_block
from r2s2r_cli.store.layout import BLOB_BYTES, BLOB_OFFSET, check_layout, on_disk
from schemas.base import ArtifactSpec, DatasetSpec
from schemas.header import Header, Provenance
from schemas.versions import KINDS

CREATED_BY = f"r2s2r {__version__}"
Check = Callable[[], None]
"""Raises what stopped the writing: a full disk, Ctrl-C."""
_CHUNK_BYTES = 1 << 18
_BLOCK_BYTES = 1 << 22
_BLOB_BUFFER = 1 << 20
_ZEROS = "0" * 64


def write_artifact(
    path: Path,
    data: ArtifactData,
    provenance: Provenance,
    *,
    title: str = "",
    content_sha256: str = "",
    replacing_now: Callable[[], None] | None = None,
) -> Header:
    """Write `data` to `path` and return its header.

    Temp file in the same directory, flush, close, reopen and verify, fsync, replace, fsync of the directory.
    `content_sha256`: the content must have this hash, or nothing is written. `replacing_now` is called once the new
    file is complete and verified, before it takes the name: what belongs to the old one can go.
    Raises ArtifactError (disk full, no permission) and leaves what was there; ValueError where `data` departs
    from the schema, which is a bug of the caller.
    """
    spec = KINDS[data.kind]
    title = title or spec.title
    draft = Header(
        kind=spec.kind, schema_version=spec.version, title=title, created_by=CREATED_BY, content_sha256=_ZEROS,
        seal_sha256=_ZEROS, body_sha256=_ZEROS, body_offset=MAX_BLOCK, body_bytes=10**15, provenance=provenance,
        datasets=dict.fromkeys(_dataset_paths(data, spec), _ZEROS),
    )  # fmt: skip
    draft = draft.model_copy(update={"body_offset": block_size(draft)})
    with replacing(path) as temp:
        _write_body(temp, data, spec, draft)
        header = _seal(temp, spec, draft)
        write_block(temp, header)
        if content_sha256 not in ("", header.content_sha256):
            raise ValueError(f"the content of {path.name} is not the one that was promised")
        if block(read_header(temp)) != block(header):
            raise ValueError(f"the header of {path.name} does not read back as it was written")
        if replacing_now is not None:
            replacing_now()
    return header


def _write_body(temp: Path, data: ArtifactData, spec: ArtifactSpec, header: Header) -> None:
    with writable(temp, "w", userblock_size=header.body_offset, libver="v110") as (file, check):
        for name, value in (
            ("kind", header.kind), ("schema_version", header.schema_version), ("title", header.title),
            ("created_by", header.created_by), ("content_sha256", _ZEROS), ("seal_sha256", _ZEROS),
        ):  # fmt: skip
            _set_attribute(file, name, value)
        for path, group in sorted(data.groups.items()):
            _write_group(file, path, group, spec, check)
            check()
        record = file.create_group(PROVENANCE)
        for name, value in header.provenance.model_dump(mode="json").items():
            text = json.dumps(value, sort_keys=True, ensure_ascii=False).encode()
            record.create_dataset(name, data=np.array(text, dtype=f"S{len(text)}"))


def _write_group(file: h5py.File, path: str, group: Group, spec: ArtifactSpec, check: Check) -> None:
    layout = spec.group(path)
    if layout is None:
        raise ValueError(f"{spec.kind} has no group {path}")
    node = file.require_group(path)
    types = {attribute.name: attribute.type for attribute in layout.attributes}
    for name, scalar in sorted(group.attributes.items()):
        whole = types.get(name) == "float" and not isinstance(scalar, str | bool)
        _set_attribute(node, name, float(scalar) if whole else scalar)  # 1 and 1.0 are one content
    for name, value in sorted(group.datasets.items()):
        dataset = layout.dataset(name)
        if dataset is None:
            raise ValueError(f"{spec.kind} has no dataset {path}/{name}")
        _write_value(node, dataset, value, check)


def _write_value(node: h5py.Group, spec: DatasetSpec, value: Value, check: Check) -> None:
    if isinstance(value, Blobs):
        (_, data_spec), (_, offset_spec) = on_disk(spec)
        _write_blobs(node.require_group(spec.path), data_spec, offset_spec, value, check)
        return
    if isinstance(value, Rows):
        _write_rows(node, spec.path, spec, value, check)
        return
    array = _text(np.asarray(value)) if spec.dtype == "str" else np.asarray(value)
    _write_rows(node, spec.path, spec, Rows(_pieces(array), array.shape, array.dtype), check)


def _text(array: np.ndarray) -> np.ndarray:
    """Text as UTF-8 bytes of the smallest width: equal words are one content, whatever they were padded to."""
    encoded = np.char.encode(array, "utf-8") if array.dtype.kind == "U" else array
    if encoded.dtype.kind != "S":
        raise ValueError(f"dtype {array.dtype}, the schema says text")
    width = max((len(item) for item in encoded.ravel().tolist()), default=0)
    return encoded.astype(f"S{max(1, width)}")


def _pieces(array: np.ndarray) -> Iterator[np.ndarray]:
    """An array in blocks of about 4 MB, so that a full disk is noticed between two of them."""
    if array.ndim == 0:
        yield array
        return
    step = max(1, _BLOCK_BYTES // max(1, array[:1].nbytes))
    for start in range(0, len(array), step):
        yield array[start : start + step]


def _write_rows(node: h5py.Group, name: str, spec: DatasetSpec, rows: Rows, check: Check) -> None:
    if spec.dtype != "str" and rows.dtype != np.dtype(spec.dtype):
        raise ValueError(f"{spec.path}: dtype {rows.dtype}, the schema says {spec.dtype}")
    target = _create(node, name, rows.shape, rows.dtype, spec)
    start = 0
    for piece in rows.blocks:
        if piece.dtype != rows.dtype or piece.shape[1:] != rows.shape[1:]:
            raise ValueError(
                f"{spec.path}: a piece of {piece.dtype} {piece.shape} in rows of {rows.dtype} {rows.shape}"
            )
        check()
        if piece.ndim == 0:
            target[()] = piece
            return
        if start + len(piece) > rows.shape[0]:
            raise ValueError(f"{spec.path}: more rows came than the {rows.shape[0]} that were promised")
        target[start : start + len(piece)] = piece
        start += len(piece)
    if rows.shape and start != rows.shape[0]:
        raise ValueError(f"{spec.path}: {start} rows came, {rows.shape[0]} were promised")


def _write_blobs(
    node: h5py.Group, data_spec: DatasetSpec, offset_spec: DatasetSpec, blobs: Blobs, check: Check
) -> None:
    offsets = [0]
    pieces = _buffered(blobs, offsets)
    first = next(pieces, b"")
    target = _create(node, BLOB_BYTES, (0,), np.dtype(np.uint8), data_spec, chunk=len(first))
    for piece in itertools.chain([first], pieces):
        check()
        start = target.shape[0]
        target.resize(start + len(piece), axis=0)
        target[start:] = np.frombuffer(piece, dtype=np.uint8)
    if len(offsets) != blobs.count + 1:
        raise ValueError(f"{data_spec.path}: {len(offsets) - 1} frames came, {blobs.count} were promised")
    array = np.array(offsets, dtype=np.uint64)
    _write_rows(node, BLOB_OFFSET, offset_spec, Rows(iter([array]), array.shape, array.dtype), check)


def _buffered(blobs: Blobs, offsets: list[int]) -> Iterator[bytes]:
    """Frames joined to pieces of about 1 MB: one HDF5 resize a piece instead of one a frame."""
    buffer = bytearray()
    for item in blobs.items:
        buffer += item
        offsets.append(offsets[-1] + len(item))
        if len(buffer) >= _BLOB_BUFFER:
            yield bytes(buffer)
            buffer.clear()
    if buffer:
        yield bytes(buffer)


def _create(
    node: h5py.Group, name: str, shape: tuple[int, ...], dtype: np.dtype, spec: DatasetSpec, *, chunk: int | None = None
) -> h5py.Dataset:
    """A new dataset with its unit. `chunk`: it will grow, and its first piece has that length."""
    options: dict[str, object] = {}
    row = max(1, int(np.prod(shape[1:], dtype=np.int64)) * dtype.itemsize)
    length = max(1, _CHUNK_BYTES // row)
    if chunk is not None:  # encoded images do not compress further
        options = {"chunks": (min(max(1, chunk), length),), "maxshape": (None,), "fletcher32": True}
    elif shape and 0 not in shape:
        options = {"chunks": (min(shape[0], length), *shape[1:]), "fletcher32": True,
                   "compression": "gzip", "compression_opts": 4, "shuffle": True}  # fmt: skip
    target = node.create_dataset(name, shape=shape, dtype=dtype, **options)
    _set_attribute(target, "unit", spec.unit)
    _set_attribute(target, "dims", ",".join(spec.dims))
    _set_attribute(target, "frame", spec.frame)
    _set_attribute(target, "description", spec.description)
    return target


def _set_attribute(node: h5py.Group | h5py.Dataset, name: str, value: Scalar) -> None:
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, str):
        if "\0" in value:
            raise ValueError(f"attribute {name} holds a NUL character, which HDF5 cuts text at")
        encoded = value.encode()  # fixed length: no object types in an artifact
        node.attrs.create(name, np.array(encoded, dtype=h5py.string_dtype("utf-8", max(1, len(encoded)))))
    elif isinstance(value, bool):
        node.attrs.create(name, np.bool_(value))
    elif isinstance(value, int):
        node.attrs.create(name, np.int64(value))
    else:
        if not np.isfinite(value):
            raise ValueError(f"attribute {name} is {value}; leave out what is not known")
        node.attrs.create(name, np.float64(value))


def _seal(temp: Path, spec: ArtifactSpec, draft: Header) -> Header:
    """Reopen, check the layout, and write the digests of what can be read back."""
    with writable(temp, "r+") as (file, _):
        nodes = nodes_of(file)
        mismatches = check_layout(file, spec, nodes)
        if mismatches:
            raise ValueError(f"not the layout of {spec.kind}: {mismatches[0]}")
        digests = digest_file(file, nodes)
        for name, digest in (("content_sha256", digests.content), ("seal_sha256", digests.seal)):
            file.attrs.modify(name, np.array(digest.encode(), dtype=h5py.string_dtype("utf-8", 64)))
    body, length = body_sha256(temp, draft.body_offset)
    return draft.model_copy(
        update={
            "content_sha256": digests.content, "seal_sha256": digests.seal, "datasets": digests.datasets,
            "body_sha256": body, "body_bytes": length,
        }
    )  # fmt: skip


def _dataset_paths(data: ArtifactData, spec: ArtifactSpec) -> Iterator[str]:
    for path, group in data.groups.items():
        layout = spec.group(path)
        for name in group.datasets:
            dataset = layout.dataset(name) if layout else None
            for disk_name, _ in on_disk(dataset) if dataset else ():
                yield f"{path}/{disk_name}"

"""Read artifacts: checked against their seal, migrated to the current version, as plain values."""

from __future__ import annotations

import contextlib
import itertools
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Value
from r2s2r_cli.errors import ArtifactError, DamageWarning, quoted
from r2s2r_cli.store.hashing import PROVENANCE, attributes, walk
from r2s2r_cli.store.hdf5_errors import translate
from r2s2r_cli.store.header import CutOff, body_sha256, mends_cut_off, read_header
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.layout import BLOB_BYTES, BLOB_OFFSET
from r2s2r_cli.store.newer import newer_r2s2r
from schemas.header import Header
from schemas.results import NodeInfo
from schemas.versions import KINDS, NoMigration, chain


def read_artifact(path: Path, kind: str | None = None, *, blobs: bool = False) -> tuple[Header, ArtifactData]:
    """Header and values of an artifact, in the layout of the current version.

    Encoded frames are left out, or with `blobs=True` read from the file one by one when they are asked for.

    Raises ArtifactError: missing, not an artifact, damaged, of another kind, or of a newer version.
    """
    header = checked_header(path, kind)
    return header, load(path, header, blobs=blobs)


def load(path: Path, header: Header, *, blobs: bool = False) -> ArtifactData:
    """The values of an artifact that has been checked, in the layout of the current version. Raises ArtifactError."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            groups = _load(file, path, blobs=blobs)
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise translate(error, path) from error
    for _, step in chain(header.kind, header.schema_version):
        groups = dict(step(groups))
    return ArtifactData(header.kind, groups)


@dataclass(frozen=True)
class StoredImages:
    """The encoded frames of a dataset, read from the file each time they are gone through."""

    path: Path
    group: str
    name: str

    def __iter__(self) -> Iterator[bytes]:
        return iter_blobs(self.path, self.group, self.name)


def iter_blobs(path: Path, group: str, name: str) -> Iterator[bytes]:
    """The encoded frames of a dataset, one at a time. The file must have been checked before."""
    with h5py.File(path, "r", locking=False) as file:
        node = file[f"{group}/{name}"]
        offsets = node[BLOB_OFFSET][()]
        for start, stop in itertools.pairwise(offsets):
            yield node[BLOB_BYTES][int(start) : int(stop)].tobytes()


def length(path: Path, dataset: str) -> int | None:
    """Length of the first axis of a dataset, or number of its encoded images; None where it is not there.

    The file must have been checked before.
    """
    with h5py.File(path, "r", locking=False) as file:
        node = file.get(dataset)
        if isinstance(node, h5py.Group):
            return len(node[BLOB_OFFSET]) - 1
        return None if node is None else len(node)


def checked_header(path: Path, kind: str | None = None, *, reader: IsolatedReader | None = None) -> Header:
    """The header, once it is certain that the file is what its writer sealed.

    `reader`: a child process to look at a file whose bytes changed; by default one is started for it.
    Raises ArtifactError otherwise. Warns DamageWarning where bytes changed that nothing reads.
    """
    header = read_header(path)
    check_kind_and_version(path, header, kind)
    check_body(path, header, reader=reader)
    return header


def check_kind_and_version(path: Path, header: Header, kind: str | None = None) -> None:
    """Raises ArtifactError: of another kind, or of a version that no chain of migrations reads."""
    _check_kind(path, header, kind)
    _check_version(path, header)


def check_body(path: Path, header: Header, *, reader: IsolatedReader | None = None) -> None:
    """Compare the bytes of the body with the seal, before any HDF5 code sees them.

    Raises ArtifactError with the damaged dataset; warns DamageWarning where only unread bytes changed.
    """
    digest, length = body_sha256(path, header.body_offset)
    if digest == header.body_sha256:
        return
    if length < header.body_bytes:
        raise CutOff(
            "the file was cut off",
            where=str(path),
            expected=f"{header.body_bytes} bytes of data",
            received=f"{length} bytes",
            hint=mends_cut_off(path, header),
        )
    with contextlib.nullcontext(reader) if reader else IsolatedReader() as child:
        report = child.verify(path)
    if report["content_ok"] and report["seal_ok"]:
        warnings.warn(f"{path}: bytes changed that nothing reads; the content hash still holds", DamageWarning, 2)
        return
    first = report["problems"][0]
    raise ArtifactError(
        first["what"],
        where=f"{path}:/{first['where'].lstrip('/')}",
        expected=first["expected"],
        received=first["received"],
        hint=f"r2s2r recover {quoted(path)}",
    )


def _check_kind(path: Path, header: Header, kind: str | None) -> None:
    if header.kind not in KINDS or (kind is not None and header.kind != kind):
        raise ArtifactError(
            "this artifact is of another kind",
            where=str(path),
            expected=kind or " | ".join(KINDS),
            received=header.kind,
            hint=f"r2s2r inspect {quoted(path)}" if header.kind in KINDS else newer_r2s2r(),
        )


def _check_version(path: Path, header: Header) -> None:
    try:
        chain(header.kind, header.schema_version)
    except NoMigration as error:
        raise ArtifactError(
            "this version of the artifact cannot be read",
            where=str(path),
            expected=f"version {KINDS[header.kind].version} of kind {header.kind}, or one that migrates to it",
            received=str(error),
            hint=newer_r2s2r(),
        ) from error


def _load(file: h5py.File, path: Path, *, blobs: bool) -> dict[str, Group]:
    """All groups as they are, whatever the version: migrations run on this."""
    groups: dict[str, Group] = {}
    for name, node in sorted(walk(file)):
        if not isinstance(node, h5py.Group) or name == PROVENANCE or set(node) == {BLOB_BYTES, BLOB_OFFSET}:
            continue
        datasets: dict[str, Value] = {}
        for child, leaf in node.items():
            if isinstance(leaf, h5py.Dataset):
                array = np.asarray(leaf[()])
                datasets[child] = array.view(array.dtype.str)  # without what h5py hangs on to dtypes of text
            elif blobs and set(leaf) == {BLOB_BYTES, BLOB_OFFSET}:
                datasets[child] = Blobs(StoredImages(path, name, child), len(leaf[BLOB_OFFSET]) - 1)
        found = attributes(node)
        if datasets or found or not len(node):
            groups[name] = Group(datasets, found)
    return groups


def describe(path: Path) -> list[NodeInfo]:
    """Groups and datasets of a checked artifact with shape, unit, frame and meaning, without reading the data."""
    nodes = []
    try:
        with h5py.File(path, "r", locking=False) as file:
            for name, node in sorted(walk(file)):
                if name.startswith(PROVENANCE):
                    continue
                found = attributes(node)
                if isinstance(node, h5py.Dataset):
                    words: dict[str, Any] = {
                        key: str(found.get(key, "")) for key in ("unit", "dims", "frame", "description")
                    }
                    nodes.append(NodeInfo(path=name, dtype=str(node.dtype), shape=node.shape, **words))
                else:
                    nodes.append(NodeInfo(path=name, attributes=found))
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise translate(error, path) from error
    return nodes

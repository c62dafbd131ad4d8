"""From a damaged artifact: every dataset that can still be read, in one `.npz` file beside it."""

from __future__ import annotations

import contextlib
import glob
import itertools
import json
import os
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.atomic import disk_error, replacing, temp_beside
from r2s2r_cli.store.canonical import file_sha256
from r2s2r_cli.store.isolated import IsolatedReader
from schemas.header import Header

REPORT = "README.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Rescue:
    """What came out of a damaged artifact."""

    path: Path | None
    """The `.npz` file; None where nothing could be rescued."""
    proven: tuple[str, ...]
    """Datasets whose digest is the one that was sealed."""
    unproven: tuple[str, ...]
    """Datasets that were read, while their sealed digests are lost with the head of the file."""
    lost: Mapping[str, str]
    """The other datasets, and why."""


def rescue(path: Path, header: Header | None, reader: IsolatedReader) -> Rescue:
    """Save what can be read of the artifact at `path`, which stays as it is. Earlier rescues stay too.

    Raises ArtifactError where the disk refuses the result.
    """
    earlier = sorted(path.parent.glob(f"{glob.escape(path.name)}.rescued*.npz"))
    names = (path.with_name(f"{path.name}.rescued{f'-{n}' if n > 1 else ''}.npz") for n in itertools.count(1))
    target = next(name for name in names if not name.exists())
    with _openable(path, header) as source:
        found = _facts(reader, source)
        digests = header.datasets if header else dict.fromkeys(found["names"], "")
        with replacing(target) as temp:
            proven, unproven, lost = _collect(reader, source, temp, digests)
            report = {
                "source": path.name, "head": header.model_dump(mode="json") if header else None, "root": found["root"],
                "attributes": found["groups"], "proven": proven, "unproven": unproven, "lost": lost,
            }  # fmt: skip
            with zipfile.ZipFile(temp, "a", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr(zipfile.ZipInfo(REPORT, _EPOCH), json.dumps(report, indent=1, sort_keys=True))
    same = [other for other in earlier if file_sha256(other) == file_sha256(target)]
    if same or not proven + unproven:
        target.unlink()
    kept = same[0] if same else target if proven + unproven else None
    return Rescue(kept, tuple(proven), tuple(unproven), lost)


@contextlib.contextmanager
def _openable(path: Path, header: Header | None) -> Iterator[Path]:
    """The file itself; or, where it was cut off, a copy with zeros at the end, since HDF5 opens no file too short."""
    whole = header.body_offset + header.body_bytes if header else 0
    if path.stat().st_size >= whole:
        yield path
        return
    copy = temp_beside(path)
    try:
        shutil.copyfile(path, copy)
        with copy.open("r+b") as file:
            file.truncate(whole)
        yield copy
    except OSError as error:
        raise disk_error(error, copy) from error
    finally:
        copy.unlink(missing_ok=True)


def _facts(reader: IsolatedReader, source: Path) -> dict[str, Any]:
    try:
        return reader.facts(source)
    except ArtifactError as error:  # the library crashed or hung; the names may stand in the head
        return {"root": {}, "groups": {}, "names": [], "problem": error.what}


def _collect(
    reader: IsolatedReader, source: Path, archive_path: Path, digests: Mapping[str, str]
) -> tuple[list[str], list[str], dict[str, str]]:
    proven: list[str] = []
    unproven: list[str] = []
    lost: dict[str, str] = {}
    piece = temp_beside(archive_path)
    try:
        with zipfile.ZipFile(archive_path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, digest in sorted(digests.items()):
                problem, received = _save(reader, source, name, piece)
                if problem:
                    lost[name] = problem
                elif digest and received != digest:
                    lost[name] = "the data changed after sealing"
                else:
                    (proven if digest else unproven).append(name)
                    _append(archive, name, piece)
    finally:
        piece.unlink(missing_ok=True)
    return proven, unproven, lost


def _save(reader: IsolatedReader, source: Path, name: str, piece: Path) -> tuple[str, str]:
    """Why the dataset could not be read (empty: it could), and its digest."""
    try:
        answer = reader.save(source, name, piece)
    except ArtifactError as error:
        return error.what, ""
    if "disk" in answer:
        # Without a file's name: the caller names the rescue, of which this piece is a part.
        raise OSError(answer["disk"], os.strerror(answer["disk"]))
    return answer["problem"], answer["digest"]


def _append(archive: zipfile.ZipFile, name: str, piece: Path) -> None:
    entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    with piece.open("rb") as source, archive.open(entry, "w", force_zip64=True) as out:
        shutil.copyfileobj(source, out, 1 << 20)

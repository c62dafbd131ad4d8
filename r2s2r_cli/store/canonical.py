"""Canonical JSON and its digest: the same settings give the same hash, whatever their order or comments."""

from __future__ import annotations

import errno
import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

_READ = 1 << 20


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no white space; floats as Python writes them; NaN refused."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def json_sha256(value: Any) -> str:
    """Digest of the canonical JSON of `value`."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def file_sha256(path: Path) -> str:
    """Digest of the bytes of a file. Raises OSError."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "not a regular file", str(path))  # a pipe would wait for ever
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_READ):
            digest.update(block)
    return digest.hexdigest()


def folder_sha256(path: Path) -> str:
    """Digest of the relative names and bytes of all files below `path`, in sorted order. Raises OSError."""
    digest = hashlib.sha256()
    for file in sorted(p for p in path.rglob("*") if p.is_file()):
        name = file.relative_to(path).as_posix().encode("utf-8", "surrogateescape")
        digest.update(name + f"\0{file_sha256(file)}\n".encode())
    return digest.hexdigest()


def source_sha256(path: Path) -> str:
    """Digest of a source that is not an artifact: a folder, the values of a TOML file, the bytes of any other.

    Comments and the order of keys in a TOML file do not count. Raises OSError.
    """
    if path.is_dir():
        return folder_sha256(path)
    if path.suffix == ".toml":
        try:
            return json_sha256(tomllib.loads(path.read_text(encoding="utf-8-sig")))
        except (ValueError, TypeError, RecursionError):  # no TOML, or values that JSON has not: its bytes then
            pass
    return file_sha256(path)

"""What stands at the head of every artifact: what it is, what it was made from, and its digests."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from schemas.base import Frozen

SHA256 = r"^[0-9a-f]{64}$"


class InputRef(Frozen):
    """Something that an artifact was made from."""

    path: str
    """Relative to the project directory, with forward slashes."""
    kind: str
    """Artifact kind, or `file` / `folder` for a source that is not an artifact."""
    schema_version: int | None = None
    sha256: str = Field(pattern=SHA256)
    """Content hash of an artifact; digest of the bytes of a file; digest of names and bytes of a folder."""


class MigrationNote(Frozen):
    """One `migrate`, kept for ever. It may have gone through several versions."""

    from_version: int
    to_version: int
    content_sha256: str = Field(pattern=SHA256)
    """Of the artifact before."""


class Provenance(Frozen):
    """How an artifact came to be. Times and machine are recorded, and never hashed into the content."""

    stage: str
    stage_version: int
    """Raised by hand when a stage computes something else from the same input."""
    argv: tuple[str, ...]
    settings: dict[str, Any]
    """The stage's effective settings, all of them."""
    overrides: dict[str, Any] = Field(default_factory=dict)
    """What of the settings came from the command line (`--set`, flags)."""
    robot: dict[str, Any] = Field(default_factory=dict)
    """The part of `robot.toml` that the stage used."""
    config_sha256: str = Field(pattern=SHA256)
    """Of settings and robot, as canonical JSON."""
    inputs: tuple[InputRef, ...] = ()
    seed: int | None = None
    device: str = "cpu"
    dtype: str = "float64"
    threads: int | None = None
    versions: dict[str, str]
    commit: str | None = None
    """Of the r2s2r source, where it runs from a checkout."""
    dirty: bool | None = None
    platform: str
    started: str
    """UTC, ISO 8601."""
    wall_s: float = Field(ge=0)
    migrations: tuple[MigrationNote, ...] = ()
    report: dict[str, Any] = Field(default_factory=dict)
    """What the stage said about its result, so that it can be said and drawn again without computing."""
    drawings: tuple[str, ...] = ()
    """Names of the pictures and the page that lie beside the artifact."""


class Header(Frozen):
    """The sealed head of an artifact file (its HDF5 user block), readable without an HDF5 library."""

    kind: str
    schema_version: int = Field(ge=1)
    title: str
    created_by: str
    content_sha256: str = Field(pattern=SHA256)
    """Over all datasets and group attributes: equal inputs, settings, seed and versions give an equal hash."""
    seal_sha256: str = Field(pattern=SHA256)
    """Over everything else that can be read: descriptions, header, provenance."""
    body_sha256: str = Field(pattern=SHA256)
    """Over the bytes of the HDF5 body, i.e. the file after the user block."""
    body_offset: int = Field(ge=4096, le=1 << 22)
    """Where the HDF5 body begins: the size of the user block [byte]."""
    body_bytes: int = Field(ge=0)
    datasets: dict[str, str]
    """Digest of each dataset by path: names the damaged one."""
    provenance: Provenance

"""Bring an artifact of an earlier version to the current one, once and for good. The old file keeps a second name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.store.atomic import keep_beside
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.read import check_kind_and_version, checked_header, load
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, MigrationNote, Provenance
from schemas.versions import KINDS


@dataclass(frozen=True)
class Migrated:
    """What `migrate` did with one artifact, or would do."""

    words: str
    from_version: int
    to_version: int
    kept: Path | None = None
    """The old file's new name."""

    @property
    def needed(self) -> bool:
        """Whether there was something to do."""
        return self.from_version != self.to_version


def plan(path: Path) -> Migrated:
    """What `migrate_file` would do. Raises ArtifactError: no artifact, or of a version that no chain leads from."""
    header = read_header(path)
    check_kind_and_version(path, header)
    current = KINDS[header.kind].version
    if header.schema_version == current:
        return Migrated(f"is current: version {current}", current, current)
    words = f"would migrate from version {header.schema_version} to {current}"
    return Migrated(words, header.schema_version, current)


def migrate_file(path: Path) -> Migrated:
    """Migrate one artifact in place; the old one stays beside it as `<name>.v<version>`, which is no artifact's name.

    Its provenance gets a note. Encoded images are copied one by one. Done once, it does nothing the second time.
    Raises ArtifactError: damaged, of a newer version, disk full. The artifact is then as it was.
    """
    planned = plan(path)
    if not planned.needed:
        return planned
    header = checked_header(path)
    data = load(path, header, blobs=True)
    kept = keep_beside(path, f".v{header.schema_version}")
    write_artifact(path, data, _noted(header, planned.to_version))
    words = f"migrated from version {planned.from_version} to {planned.to_version}; the old file is {kept.name}"
    return Migrated(words, planned.from_version, planned.to_version, kept)


def _noted(header: Header, version: int) -> Provenance:
    note = MigrationNote(from_version=header.schema_version, to_version=version, content_sha256=header.content_sha256)
    return header.provenance.model_copy(update={"migrations": (*header.provenance.migrations, note)})

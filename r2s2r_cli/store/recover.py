"""After a crash or damage: seal what was being recorded, restore what can be proven, rescue the rest.

Nothing is overwritten: what is replaced keeps a second name (`.damaged`), what is rescued gets a new one.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.measured import MEASURED
from r2s2r_cli.store.again import command_again, command_at
from r2s2r_cli.store.atomic import keep_beside, replacing
from r2s2r_cli.store.header import NotAnArtifact, block, body_sha256, read_header, sealed_header, unreadable
from r2s2r_cli.store.imported import look_at
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.project import JOURNAL_SUFFIX, artifact_of
from r2s2r_cli.store.read import check_kind_and_version, checked_header, load
from r2s2r_cli.store.rescue import Rescue, rescue
from r2s2r_cli.store.seal import seal
from r2s2r_cli.store.verify import find_body
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, Provenance
from schemas.versions import KINDS, STAGE_VERSIONS

DAMAGED = ".damaged"


@dataclass(frozen=True)
class Recovered:
    """What `recover` did with one file."""

    words: str
    rows: dict[str, int] = field(default_factory=dict)
    """Rows sealed, by stream."""
    changed: bool = True
    """Whether anything on disk is different now."""


def recover_file(path: Path, reader: IsolatedReader) -> Recovered:
    """Recover one journal or artifact.

    Raises ArtifactError where the artifact cannot be restored (after rescuing what can be read), or is no artifact.
    """
    if path.name.endswith(JOURNAL_SUFFIX):
        return _recover_journal(path)
    try:
        header: Header | None = read_header(path)
    except NotAnArtifact:
        header = None
    if header is None:
        return _without_head(path, reader)
    check_kind_and_version(path, header)
    return _with_head(path, header, reader)


def is_intact(path: Path) -> bool:
    """Whether head and body are byte for byte what was sealed; no HDF5 code sees the file."""
    try:
        sealed_header(path)
    except ArtifactError:
        return False
    return True


def _recover_journal(path: Path) -> Recovered:
    target = artifact_of(path)
    sealed = seal(path, target, recovered=True)
    if sealed.header is None:
        kept = ", what there is of one kept as .journal-damaged" if sealed.torn_bytes or sealed.lost_bytes else ""
        return Recovered(f"held no whole row: removed{kept}")
    words = f"sealed as {target.name}: {sum(sealed.rows.values())} rows"
    if sealed.torn_bytes:
        words += f", the torn last row ({sealed.torn_bytes} bytes) left out"
    if sealed.lost_bytes:
        words += f", {sealed.lost_bytes} damaged bytes skipped and the journal kept as .journal-damaged"
    return Recovered(words, sealed.rows)


def _with_head(path: Path, header: Header, reader: IsolatedReader) -> Recovered:
    """The head is whole, so the digests are known: compare the body with them."""
    digest, length = body_sha256(path, header.body_offset)
    if digest == header.body_sha256:
        return Recovered("intact, nothing to do", changed=False)
    if length > header.body_bytes:
        cut, _ = body_sha256(path, header.body_offset, header.body_bytes)
        if cut == header.body_sha256:
            return _restored(path, header, "bytes that were appended to it are gone")
    report = _verify(path, reader)
    if report["content_ok"] and report["seal_ok"]:
        header = header.model_copy(update={"body_sha256": digest, "body_bytes": length})
        return _restored(path, header, "only bytes that nothing reads had changed; sealed again")
    if report["content_ok"] and header.schema_version == KINDS[header.kind].version:
        return _rewritten(path, header)
    raise _lost(path, header, rescue(path, header, reader))


def _without_head(path: Path, reader: IsolatedReader) -> Recovered:
    """The head is gone: the body holds a copy of it, with its own digests."""
    try:
        offset = find_body(path)
    except OSError as error:
        raise unreadable(path, error) from error
    if offset is None:
        raise ArtifactError("there is no artifact in this file", where=str(path), expected="an artifact of r2s2r",
                            received="neither its head nor an HDF5 body",
                            hint=command_at(path) or look_at(path))  # fmt: skip
    header = _rebuilt(path, offset, reader)
    if header is None:
        raise _lost(path, None, rescue(path, None, reader))
    check_kind_and_version(path, header)
    return _restored(path, header, "its damaged head was made again from the copy inside")


def _rebuilt(path: Path, offset: int, reader: IsolatedReader) -> Header | None:
    """The header that the body gives, where the digests in it prove everything; else None."""
    try:
        facts = reader.facts(path)
    except ArtifactError:
        return None
    root = facts["root"]
    if facts["problem"] or (facts["content"], facts["seal"]) != (root.get("content_sha256"), root.get("seal_sha256")):
        return None
    digest, length = body_sha256(path, offset)
    try:
        return Header.model_validate(
            {
                "kind": root.get("kind"), "schema_version": root.get("schema_version"), "title": root.get("title"),
                "created_by": root.get("created_by"), "content_sha256": facts["content"],
                "seal_sha256": facts["seal"], "body_sha256": digest, "body_offset": offset, "body_bytes": length,
                "datasets": facts["datasets"], "provenance": Provenance.model_validate(facts["provenance"]),
            }
        )  # fmt: skip
    except ValidationError:
        return None


def _restored(path: Path, header: Header, words: str) -> Recovered:
    """Head and body as they should be, under the old name; the damaged file keeps a name of its own."""
    kept = keep_beside(path, DAMAGED)
    with replacing(path) as temp:
        with path.open("rb") as source, temp.open("wb") as out:
            out.write(block(header))
            source.seek(header.body_offset)
            shutil.copyfileobj(source, out, 1 << 20)
            out.truncate(header.body_offset + header.body_bytes)
        checked_header(temp)
    return Recovered(f"restored: {words}; what it was is kept as {kept.name}")


def _rewritten(path: Path, header: Header) -> Recovered:
    """All data are proven, a description or the record inside is not: write it again from the data and the head."""
    data = load(path, header, blobs=True)
    kept = keep_beside(path, DAMAGED)
    write_artifact(path, data, header.provenance, title=header.title, content_sha256=header.content_sha256)
    return Recovered(f"restored: every dataset was whole, what describes them was not; kept as {kept.name}")


def _verify(path: Path, reader: IsolatedReader) -> dict[str, bool]:
    try:
        return reader.verify(path)
    except ArtifactError:
        return {"content_ok": False, "seal_ok": False}


def _lost(path: Path, header: Header | None, found: Rescue) -> ArtifactError:
    saved = len(found.proven) + len(found.unproven)
    count = saved + len(found.lost)
    names = ", ".join(f"{name} ({why})" for name, why in list(found.lost.items())[:3])
    more = f" and {len(found.lost) - 3} more" if len(found.lost) > 3 else ""
    where = f"{path}, rescued into {found.path}" if found.path else str(path)
    if header is not None and header.provenance.stage in STAGE_VERSIONS:  # another program's command line is no hint
        # A hint moves no robot: of what was measured it looks, and whoever pastes it decides.
        hint = command_again(header.provenance, path, force=True, dry_run=header.provenance.stage in MEASURED)
    elif (hint := command_at(path)) == "":
        hint = f"unzip -p {quoted(found.path)} README.json" if found.path else f"ls -la {quoted(path)}*"
    return ArtifactError(
        f"the artifact cannot be restored; {saved} of {count} datasets were rescued" if count
        else "the artifact cannot be restored, and nothing in it can be read",
        where=where,
        expected="data with the digests that were sealed" if header else "an intact head, or a body that proves itself",
        received=f"lost: {names}{more}" if names else "a head and a record that do not fit the data",
        hint=hint,
    )  # fmt: skip

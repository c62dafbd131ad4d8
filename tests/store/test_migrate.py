"""Migrations: an artifact of any earlier version is read, and can be rewritten, as one of the current version."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store import migrate as module
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.migrate import migrate_file, plan
from r2s2r_cli.store.read import read_artifact
from tests.support.builders import provenance
from tests.support.layouts import same
from tests.support.versions import IMAGES, LENGTHS_MM, current, write_toy


def check_current(data: ArtifactData) -> None:
    """The values of version 3, wherever they came from."""
    group = data.groups["runs/x"]
    assert set(group.datasets) == {"distance", "image"} and group.attributes == {"origin": "migrated"}
    assert np.array_equal(group["distance"], LENGTHS_MM / 1000)
    images = group.datasets["image"]
    assert isinstance(images, Blobs) and list(images.items) == IMAGES


@pytest.mark.parametrize("version", [1, 2, 3])
def test_every_version_is_read_as_the_current_one(tmp_path: Path, version: int) -> None:
    """The chain of steps is applied while reading; the file stays as it is."""
    path = tmp_path / "90-toy.h5"
    header = write_toy(path, version)
    before = path.read_bytes()
    with current(3):
        found, data = read_artifact(path, "toy", blobs=True)
    check_current(data)
    assert found == header and found.schema_version == version and path.read_bytes() == before


@pytest.mark.parametrize("version", [1, 2])
def test_migrating_writes_the_current_version(tmp_path: Path, version: int) -> None:
    """The rewritten file is version 3, with its history; the old one stays beside it, byte by byte."""
    path = tmp_path / "90-toy.h5"
    old = write_toy(path, version)
    before = path.read_bytes()
    with current(3):
        result = migrate_file(path)
        header, data = read_artifact(path, "toy", blobs=True)
        check_current(data)
        assert result.kept is not None and result.kept.name == f"90-toy.h5.v{version}"
        assert read_header(result.kept) == old and result.kept.read_bytes() == before
    assert (header.schema_version, result.from_version, result.to_version) == (3, version, 3)
    (note,) = header.provenance.migrations
    assert (note.from_version, note.to_version, note.content_sha256) == (version, 3, old.content_sha256)
    assert header.provenance.model_copy(update={"migrations": ()}) == old.provenance == provenance()


def test_migrating_twice_changes_nothing_more(tmp_path: Path) -> None:
    """The second time there is nothing to do."""
    path = tmp_path / "90-toy.h5"
    write_toy(path)
    with current(3):
        migrate_file(path)
        before = path.read_bytes()
        result = migrate_file(path)
    assert not result.needed and path.read_bytes() == before and len(list(tmp_path.iterdir())) == 2


def test_migrating_step_by_step_over_releases_keeps_every_note(tmp_path: Path) -> None:
    """1 to 2 with one release, 2 to 3 with the next: two notes, two old files, the content of the direct way."""
    path, direct = tmp_path / "90-toy.h5", tmp_path / "direct.h5"
    write_toy(path)
    write_toy(direct)
    with current(2):
        migrate_file(path)
    with current(3):
        migrate_file(path)
        migrate_file(direct)
        one, two = read_artifact(path, blobs=True), read_artifact(direct, blobs=True)
    assert [(n.from_version, n.to_version) for n in one[0].provenance.migrations] == [(1, 2), (2, 3)]
    assert one[0].content_sha256 == two[0].content_sha256 and same(one[1], two[1])
    assert {p.name for p in tmp_path.iterdir()} >= {"90-toy.h5.v1", "90-toy.h5.v2"}


def test_what_is_migrated_equals_what_is_written_new(tmp_path: Path) -> None:
    """The content hash is that of the same data written by the current version."""
    write_toy(tmp_path / "old.h5", 1)
    new = write_toy(tmp_path / "new.h5", 3)
    with current(3):
        migrate_file(tmp_path / "old.h5")
    assert read_header(tmp_path / "old.h5").content_sha256 == new.content_sha256


def test_a_newer_version_cannot_be_migrated_back(tmp_path: Path) -> None:
    """It is refused with the way out, and stays as it is."""
    path = tmp_path / "90-toy.h5"
    write_toy(path, 3)
    with current(2), pytest.raises(ArtifactError, match="cannot be read") as caught:
        migrate_file(path)
    assert "newer" in caught.value.received and caught.value.exit_code == 4
    assert [p.name for p in tmp_path.iterdir()] == ["90-toy.h5"]


def test_a_missing_step_is_an_error(tmp_path: Path) -> None:
    """A chain with a hole does not skip over it."""
    path = tmp_path / "90-toy.h5"
    write_toy(path, 1)
    with pytest.MonkeyPatch.context() as patch:
        from schemas.versions import KINDS
        from tests.support.versions import SPECS

        patch.setitem(KINDS, "toy", SPECS[3])
        with pytest.raises(ArtifactError) as caught:
            plan(path)
    assert "no step from version 1 to 2" in caught.value.received


def test_a_damaged_artifact_is_not_migrated(tmp_path: Path) -> None:
    """Migration would seal the damage: it is refused first."""
    path = tmp_path / "90-toy.h5"
    write_toy(path)
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)
    with current(3), pytest.raises(ArtifactError):
        migrate_file(path)
    assert path.read_bytes() == bytes(content)


def test_a_step_that_gives_another_layout_writes_nothing(tmp_path: Path) -> None:
    """A faulty step is a bug that is found before the old file is replaced."""
    path = tmp_path / "90-toy.h5"
    write_toy(path, 2)
    before = path.read_bytes()
    with current(3, {("toy", 2): lambda groups: groups}), pytest.raises(ValueError, match="no dataset"):
        migrate_file(path)
    assert path.read_bytes() == before


def test_a_kill_between_keeping_and_replacing_is_repeated_without_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The old file has two names then; the next attempt uses the one that is there."""
    path = tmp_path / "90-toy.h5"
    write_toy(path)

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with current(3):
        monkeypatch.setattr(module, "write_artifact", killed)
        with pytest.raises(KeyboardInterrupt):
            migrate_file(path)
        monkeypatch.undo()
        migrate_file(path)
    assert {p.name for p in tmp_path.iterdir()} == {"90-toy.h5", "90-toy.h5.v1"}


def test_no_earlier_old_file_is_overwritten(tmp_path: Path) -> None:
    """A name that is taken by other content is left to it."""
    path = tmp_path / "90-toy.h5"
    (tmp_path / "90-toy.h5.v1").write_text("mine")
    write_toy(path)
    before = path.read_bytes()
    with current(3):
        result = migrate_file(path)
    assert (tmp_path / "90-toy.h5.v1").read_text() == "mine"
    assert result.kept is not None and result.kept.read_bytes() == before

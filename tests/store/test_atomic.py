"""Files are whole or absent, and nothing is ever lost by a name that is taken."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.atomic import creating, disk_error, keep_beside, replacing, sweep, temp_beside, write_text


def test_a_failure_keeps_the_old_file_and_no_temp_file(tmp_path: Path) -> None:
    """An exception after half of the new content leaves the old one."""
    path = tmp_path / "a.toml"
    write_text(path, "old")
    with pytest.raises(ZeroDivisionError), replacing(path) as temp:
        temp.write_text("ne")
        raise ZeroDivisionError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_the_new_file_appears_only_when_it_is_whole(tmp_path: Path) -> None:
    """While it is written there is no file of that name."""
    path = tmp_path / "deep" / "a.toml"
    with replacing(path) as temp:
        temp.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"


def test_creating_never_overwrites(tmp_path: Path) -> None:
    """Where another process was faster, its file stays and FileExistsError says so."""
    path = tmp_path / "a"
    with pytest.raises(FileExistsError), creating(path) as temp:
        temp.write_text("late")
        path.write_text("early")
    assert path.read_text() == "early" and list(tmp_path.iterdir()) == [path]


def test_sweep_takes_unfinished_files_only(tmp_path: Path) -> None:
    """Temp files of killed writers go; everything else stays, also what other programs call partial."""
    mine = temp_beside(tmp_path / "10-record.h5")
    others = [tmp_path / name for name in (".firefox.partial", "x.partial", ".hidden", "10-record.h5.journal")]
    for path in (mine, *others):
        path.touch()
    assert sweep(tmp_path) == [mine]
    assert sorted(tmp_path.iterdir()) == sorted(others)


@pytest.mark.parametrize("links", [True, False], ids=["hard links", "no hard links"])
def test_keep_beside_keeps_every_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    """Each kept file has a name of its own and its content; the same file kept twice has one."""
    if not links:
        monkeypatch.setattr(os, "link", _no_links)
    path = tmp_path / "a.h5"
    kept = []
    for text in ("one", "two", "three"):
        with replacing(path) as temp:
            temp.write_text(text)
        kept.append(keep_beside(path, ".damaged"))
        if links:
            assert keep_beside(path, ".damaged") == kept[-1]
    assert [p.name for p in kept] == ["a.h5.damaged", "a.h5.damaged.2", "a.h5.damaged.3"]
    assert [p.read_text() for p in kept] == ["one", "two", "three"] and path.read_text() == "three"


def test_without_hard_links_creating_still_never_overwrites(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a file system without hard links the name is checked before the move."""
    monkeypatch.setattr(os, "link", _no_links)
    with creating(tmp_path / "a") as temp:
        temp.write_text("first")
    with pytest.raises(FileExistsError), creating(tmp_path / "a") as temp:
        temp.write_text("second")
    assert (tmp_path / "a").read_text() == "first" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("number", "what"),
    [(28, "full"), (122, "full"), (13, "written to"), (30, "written to"), (27, "larger"), (5, "not be")],
)
def test_the_system_s_refusals_are_said_in_words(tmp_path: Path, number: int, what: str) -> None:
    """Each error number becomes a sentence, a place, and a command to look further."""
    error = disk_error(OSError(number, os.strerror(number)), tmp_path / "x.h5")
    assert isinstance(error, ArtifactError) and what in error.what
    assert error.where and error.received and error.hint


@pytest.mark.parametrize("number", [28, 13, 5])
def test_a_refusal_is_looked_at_where_something_is(tmp_path: Path, number: int) -> None:
    """The folder of the file may be what could not be made."""
    error = disk_error(OSError(number, os.strerror(number)), tmp_path / "robot" / "exported" / "x.csv")
    assert error.hint.endswith(f" {tmp_path}")


def _no_links(*_: object) -> None:
    raise OSError(1, "Operation not permitted")

"""Commands on a full disk: exit code 4 with a hint, the project as it was, and all well once there is space."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from r2s2r_cli.store.project import journal_of
from tests.commands.conftest import document, invoke
from tests.support import recorder
from tests.support.small_disk import PAGE, SmallDisk, small_disk

DISK = 8 << 20


@pytest.fixture
def disk(tmp_path: Path, templates: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SmallDisk]:
    """A project with a recording and an estimate on a disk of its own, as the working directory."""
    with small_disk(tmp_path / "disk", DISK) as mounted:
        shutil.copytree(templates / "done", mounted.path / "robot")
        monkeypatch.chdir(mounted.path / "robot")
        yield mounted
        monkeypatch.chdir(tmp_path)


def snapshot(disk: SmallDisk) -> dict[str, bytes]:
    """Every file of the project but the lock's."""
    return {name: (disk.path / name).read_bytes() for name in disk.names() if ".r2s2r/" not in name}


WRITERS = {
    "init": ("init", "../another", "--sample"),
    "import": ("import", "sample.csv", "--force"),
    "import of another log": ("import", "sample.csv", "--iteration", "2"),
    "estimate": ("estimate", "--force"),
    "export to CSV": ("export", "iterations/001/10-record.h5", "--out", "../out"),
    "export to npz": ("export", "iterations/001/20-estimate.h5", "--to", "npz", "--out", "../out"),
}


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.parametrize("free", [0, 2 * PAGE])
def test_a_command_that_finds_no_space_harms_nothing(disk: SmallDisk, command: str, free: int) -> None:
    """It says what is wrong and where to look; no file of the project changes, no unfinished file stays."""
    before = snapshot(disk)
    disk.fill(leave=free)
    result = invoke(*WRITERS[command])
    assert result.exit_code == 4, (result.stdout, result.stderr)
    assert "disk is full" in result.stderr and "hint: df -h" in result.stderr and "Traceback" not in result.stderr
    after = snapshot(disk)
    assert {name: after[name] for name in before} == before
    assert not [name for name in after if name.endswith(".partial")]
    disk.empty()
    shutil.rmtree(disk.path / "another", ignore_errors=True)
    shutil.rmtree(disk.path / "out", ignore_errors=True)
    drawn = free > 0 or command.startswith(("init", "export"))  # pictures take longest, and once shows that they come
    again = invoke(*WRITERS[command], *(() if drawn else ("--no-draw",)))
    assert again.exit_code == 0, again.stderr


def test_looking_needs_no_space(disk: SmallDisk) -> None:
    """`status`, `inspect` and `validate` work on a full disk."""
    disk.fill()
    assert [a["state"] for a in document("status")["artifacts"]] == ["fresh", "fresh"]
    assert invoke("inspect", "iterations/001/20-estimate.h5").exit_code == 0
    assert invoke("validate", "iterations/001/20-estimate.h5").exit_code == 0


def test_recover_and_migrate_find_no_space(disk: SmallDisk) -> None:
    """The journal stays; once there is space it is sealed."""
    journal = journal_of(disk.path / "robot" / "iterations" / "002" / "10-record.h5")
    recorder.write(journal, 2000)
    before = journal.read_bytes()
    disk.fill(leave=PAGE)
    result = invoke("recover")
    assert result.exit_code == 4 and "disk is full" in result.stderr and journal.read_bytes() == before
    assert invoke("migrate").exit_code == 0, "there was nothing to migrate"
    disk.empty()
    assert sum(document("recover")["rows"].values()) == sum(recorder.counts(2000).values())

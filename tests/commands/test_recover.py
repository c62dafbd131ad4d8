"""`r2s2r recover` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from r2s2r_cli.store.atomic import temp_beside
from r2s2r_cli.store.checkpoint import CheckpointFile, checkpoint_of
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Project, journal_of
from schemas.results import RecoverResult
from tests.commands.conftest import document, invoke
from tests.support import recorder


@pytest.fixture
def cut_off(project: Path) -> Path:
    """A project whose recording was cut off."""
    journal = journal_of(project / "iterations" / "001" / "10-record.h5")
    recorder.write(journal, 9)
    journal.write_bytes(journal.read_bytes()[:-1])
    return journal


def test_without_files_the_project_is_recovered(cut_off: Path) -> None:
    """The journal becomes its artifact, temp files go, and then there is nothing to do."""
    temp = temp_beside(cut_off.with_name("20-estimate.h5"))
    temp.touch()
    assert document("status")["next"].startswith("r2s2r recover")
    result = RecoverResult.model_validate(document("recover"))
    (words,) = result.files.values()
    assert "sealed as 10-record.h5" in words and "torn last row" in words
    assert result.removed == (str(temp),) and sum(result.rows.values()) == sum(recorder.counts(9).values()) - 1
    assert cut_off.with_name("10-record.h5").exists() and not cut_off.exists() and not temp.exists()
    again = invoke("recover")
    assert (again.exit_code, again.stdout) == (0, "") and "nothing to recover" in again.stderr


def test_what_was_interrupted_is_left_and_named(project: Path) -> None:
    """A checkpoint is no wreck: recover keeps it and says what goes on from it."""
    place = Project.find(project).iteration(1, create=True)
    place.path.mkdir(parents=True)
    kept = checkpoint_of(place.artifact("plan"))
    CheckpointFile(kept, "0" * 64, command=("plan", "--to=1,2,0")).save({"cost": 1.0})
    result = invoke("recover")
    assert (result.exit_code, result.stdout) == (0, "") and kept.exists()
    said = result.stderr.splitlines()
    use = "--resume goes on with what is kept: r2s2r plan --to=1,2,0 --resume"
    assert said[1:] == [f"iterations/001/40-plan.partial: interrupted; {use}"]
    assert "nothing to recover" in said[0] and "unfinished" not in said[0]


def test_what_is_recovered_validates(cut_off: Path) -> None:
    """The sealed recording passes the checks of form: it is a recording like any other."""
    del cut_off
    document("recover")
    result = json.loads(invoke("validate", "iterations/001/10-record.h5", "--json").stdout)
    assert [f for f in result["findings"] if f["check"] in ("layout-matches", "content-intact", "file-opens")] == []
    assert result["unreadable"] == []


def test_a_live_recording_is_not_touched(cut_off: Path) -> None:
    """While somebody writes in the project, recover says who, and changes nothing."""
    before = cut_off.read_bytes()
    with writing(Project.find().root, "record"):
        result = invoke("recover")
    assert result.exit_code == 2 and "r2s2r record" in result.stderr and cut_off.read_bytes() == before


def test_one_hopeless_file_does_not_stop_the_others(estimated: Path, cut_off: Path | None = None) -> None:
    """Exit code 4 with the reason; what can be recovered is."""
    del cut_off
    record, estimate = (estimated / "iterations" / "001" / name for name in ("10-record.h5", "20-estimate.h5"))
    damaged = bytearray(record.read_bytes())
    damaged[300] ^= 1
    record.write_bytes(damaged)
    estimate.write_bytes(estimate.read_bytes()[:-5000])
    result = invoke("recover", str(estimate), str(record), "--json")
    answer = json.loads(result.stdout)
    assert result.exit_code == 4 and "Traceback" not in result.stderr and "hint: r2s2r" in result.stderr
    assert set(answer["failed"]) == {str(estimate)} and "restored" in answer["files"][str(record)]
    assert estimate.with_name("20-estimate.h5.rescued.npz").exists()
    assert json.loads(invoke("validate", str(record), "--json").stdout)["unreadable"] == []


def test_a_file_outside_of_any_project_can_be_recovered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A journal somebody sent by mail needs no project."""
    monkeypatch.chdir(tmp_path)
    recorder.write(tmp_path / "mail.h5.journal", 3)
    document("recover", "mail.h5.journal")
    assert (tmp_path / "mail.h5").exists()


@pytest.mark.parametrize("name", ["missing.h5", "missing.h5.journal", "robot.toml", "iterations"])
def test_what_cannot_be_recovered_is_an_error_in_words(project: Path, name: str) -> None:
    """Missing files, other files and folders: exit code 4 and a hint."""
    (project / "iterations").mkdir(exist_ok=True)
    result = invoke("recover", name)
    assert result.exit_code == 4 and "hint: " in result.stderr and "Traceback" not in result.stderr


def test_bytes_that_nothing_reads_are_one_line_of_warning(estimated: Path) -> None:
    """The command goes on, with exit code 0 and no line of Python; `recover` makes the file what it was."""
    record = estimated / "iterations" / "001" / "10-record.h5"
    original = record.read_bytes()
    record.write_bytes(original + b"tail")
    result = invoke("inspect", str(record))
    assert result.exit_code == 0
    assert result.stderr == f"warning: {record}: bytes changed that nothing reads; the content hash still holds\n"
    document("recover", str(record))
    assert record.read_bytes() == original and invoke("inspect", str(record)).stderr == ""

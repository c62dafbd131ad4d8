"""`validate`: selection of checks, files of every other sort, one document, one child process."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import h5py
import pytest

from r2s2r_cli.commands.validate import _show
from r2s2r_cli.console import Console
from r2s2r_cli.store import isolated
from schemas.results import Finding, ValidateResult
from tests.commands.conftest import invoke
from tests.support.forge import forge, put

RECORDING = Path("iterations/001/10-record.h5")


def test_only_what_is_selected_runs(estimated: Path) -> None:
    """--select runs the named checks only, --ignore all but the named ones; both together subtract."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 1.5))
    assert invoke("validate", "--select", "controls_in_range").exit_code == 0
    result = invoke("validate", "--select", "controls_in_range,targets_in_range", "--json")
    assert result.exit_code == 3
    assert json.loads(result.stdout)["checks"] == ["targets_in_range", "controls_in_range"]
    ignored = "targets_in_range,targets_constant,inputs_match"
    assert invoke("validate", "--ignore", ignored).exit_code == 0
    both = ("--select", "targets_in_range", "--ignore", "targets_in_range")
    assert json.loads(invoke("validate", *both, "--json").stdout)["checks"] == []


def test_what_cannot_be_read_is_never_passed(estimated: Path) -> None:
    """A damaged file fails whatever is selected."""
    with h5py.File(RECORDING, "r+") as file:
        file["runs/sample/caps/t"][3] += 1e-3
    assert invoke("validate", str(RECORDING), "--select", "robot_was_measured").exit_code == 4


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (("--select", "time_increase"), "r2s2r validate --select time_increases"),
        (("--ignore", "rods_rigid"), "r2s2r validate --ignore rods_are_rigid"),
        (("--select", "qqqq"), "r2s2r validate --help   # docs/reference/checks.md lists the checks"),
        (("--select", ","), "r2s2r validate --select file_opens"),
        (("--ignore", "content_intact"), "r2s2r validate"),
        (("--ignore", "content_intact,seldom_lost,file_opens"), "r2s2r validate --ignore seldom_lost"),
        (("robot.toml", "--iteration", "1"), "r2s2r validate --iteration 1"),
    ],
)
def test_wrong_requests_are_usage_errors(project: Path, arguments: tuple[str, ...], hint: str) -> None:
    """Unknown names come with the nearest known one; what cannot be asked for says what can."""
    result = invoke("validate", *arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.splitlines()[-1] == f"hint: {hint}"


def test_an_iteration_that_is_not_there(estimated: Path) -> None:
    """--iteration of a number that does not exist is a usage error."""
    assert invoke("validate", "--iteration", "7").exit_code == 2


def test_without_a_project_there_is_nothing_to_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No files and no project: code 4, and the hint makes one."""
    monkeypatch.chdir(tmp_path)
    for arguments in ((), ("--project", "nowhere")):
        result = invoke("validate", *arguments)
        assert result.exit_code == 4
        assert result.stderr.splitlines()[-1] == "hint: r2s2r init myrobot && cd myrobot"


def _write(path: str, content: bytes) -> None:
    Path(path).write_bytes(content)


def test_other_files_are_refused_in_words(project: Path) -> None:
    """Missing, empty, text, another program's HDF5, a directory, a pipe, a CSV: code 4, one finding each, no hang."""
    _write("empty.h5", b"")
    _write("text.h5", b"hello\n")
    _write("noise.h5", bytes(range(256)) * 40)
    _write("binary.toml", b"\xff\xfe\x00")
    _write("empty.toml", b"")
    _write("unknown.toml", b"[tool]\nx = 1\n")
    with h5py.File("foreign.h5", "w") as file:
        file["x"] = [1, 2]
    Path("folder.h5").mkdir()
    os.mkfifo("pipe.h5")
    os.mkfifo("pipe.toml")
    names = ["empty.h5", "text.h5", "noise.h5", "foreign.h5", "folder.h5", "pipe.h5", "pipe.toml", "missing.h5",
             "missing.toml", "binary.toml", "empty.toml", "unknown.toml", "sample.csv"]  # fmt: skip
    result = invoke("validate", *names, "--json")
    document = ValidateResult.model_validate(json.loads(result.stdout))
    assert result.exit_code == 4
    assert document.unreadable == tuple(names)
    assert [f.check for f in document.findings] == ["file_opens"] * len(names)
    assert all(f.what and f.hint for f in document.findings)
    assert document.findings[-1].hint == "r2s2r import sample.csv"


def test_errors_leave_one_document(estimated: Path) -> None:
    """With --json stdout is one document, whatever was found; the error goes to stderr."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 1.5))
    result = invoke("validate", str(RECORDING), "--json")
    assert result.exit_code == 3
    assert json.loads(result.stdout)["schema"] == "r2s2r.validate/1"
    assert result.stderr.startswith("error: ")


def test_damaged_files_share_one_child(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many damaged files are read by one child process; sound ones need none."""
    started: list[Any] = []
    original = subprocess.Popen

    def counting(*arguments: Any, **options: Any) -> Any:
        started.append(arguments)
        return original(*arguments, **options)

    monkeypatch.setattr(isolated.subprocess, "Popen", counting)
    assert invoke("validate", str(RECORDING)).exit_code == 0
    assert started == []
    for name in ("a.h5", "b.h5", "c.h5"):
        content = bytearray(RECORDING.read_bytes())
        content[-len(content) // 3] ^= 1
        Path(name).write_bytes(content)
    assert invoke("validate", "a.h5", "b.h5", "c.h5").exit_code == 4
    assert len(started) == 1


def test_equal_findings_are_shown_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Findings that say the same of several places are one block with a count, errors before warnings."""
    facts = {"file": "a.h5", "what": "it is wrong", "expected": "right", "received": "wrong", "hint": "mend it"}
    warning = Finding(check="x", importance="warning", location="runs/a", **facts)
    errors = [Finding(check="y", importance="error", location=f"runs/{name}", **facts) for name in "abc"]
    result = ValidateResult(files=("a.h5",), checks=("x", "y"), findings=(warning, *errors), unreadable=(), errors=3,
                            warnings=1, advice=0)  # fmt: skip
    _show(result, Console())
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["error: it is wrong  [y]", "  where:    a.h5: runs/a (and 2 more places)"]
    assert lines[6] == "warning: it is wrong  [x]"
    assert lines[-1] == "1 file, 2 kinds of checks: 3 errors, 1 warning, 0 advice"

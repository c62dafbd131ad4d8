"""Bytes that changed inside an artifact: plain `status` reads none and says so, `status --check` finds them."""

from __future__ import annotations

import json
from pathlib import Path

from tests.commands.conftest import document, invoke

ESTIMATE = "iterations/001/20-estimate.h5"
NOT_READ = "heads and sizes were read, contents were not; to compare every byte: r2s2r status --check"


def spoil(path: Path) -> None:
    """Change eight bytes in the middle."""
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 8] = bytes(255 ^ one for one in content[middle : middle + 8])
    path.write_bytes(content)


def test_what_was_not_read_is_said(estimated: Path) -> None:
    """Below the table and before the hint; with nothing in the project nothing is said, nor with --check."""
    spoil(estimated / ESTIMATE)
    shown = invoke("status")
    assert shown.exit_code == 0 and shown.stderr.splitlines()[0] == NOT_READ
    assert shown.stderr.splitlines()[-1] == f"hint: {document('status')['next']}"
    assert NOT_READ not in invoke("status", "--quiet").stderr
    checked = invoke("status", "--check")
    assert checked.exit_code == 3 and NOT_READ not in checked.stderr
    assert "damaged" in checked.stdout and checked.stderr.splitlines()[-1] == f"hint: r2s2r recover {ESTIMATE}"


def test_an_empty_project_has_no_contents(project: Path) -> None:
    """No artifact, no remark on them."""
    assert NOT_READ not in invoke("status").stderr


def test_a_damaged_artifact_keeps_its_stage(estimated: Path) -> None:
    """As its head says, where that is whole, else as its place does; policies of another program have none."""
    recording = "iterations/001/10-record.h5"
    spoil(estimated / recording)
    (estimated / ESTIMATE).write_bytes(b"")
    names = ["calibration.h5", "floor.h5", "policies.h5", "iterations/001/50-execute.h5"]
    for name in names:
        (estimated / name).write_bytes(b"")
    result = invoke("status", "--check", "--json")
    found = {one["artifact"]: one for one in json.loads(result.stdout)["artifacts"]}
    assert {name: one["stage"] for name, one in found.items()} == {
        recording: "import", ESTIMATE: "estimate", "calibration.h5": "calibrate", "floor.h5": "floor",
        "policies.h5": "-", "iterations/001/50-execute.h5": "execute",
    }  # fmt: skip
    assert found[recording]["mend"] == f"r2s2r recover {recording}"
    assert found[ESTIMATE]["mend"] == "r2s2r estimate --iteration 1"


def test_what_was_made_of_a_damaged_artifact_says_that_it_is_damaged(estimated: Path) -> None:
    """It is stale; its input is not called so."""
    recording = "iterations/001/10-record.h5"
    spoil(estimated / recording)
    found = {one["artifact"]: one for one in json.loads(invoke("status", "--check", "--json").stdout)["artifacts"]}
    assert (found[recording]["state"], found[ESTIMATE]["state"]) == ("damaged", "stale")
    assert found[ESTIMATE]["reasons"] == [f"input {recording} is damaged"]
    said = invoke("status", "--check").stderr
    assert "error: 2 of 2 artifacts are not fresh, 1 damaged" in said and f"where: {recording}" in said


def test_a_recording_without_a_head_is_a_robots_unless_its_logs_are_there(estimated: Path) -> None:
    """The name of a recording is that of both: the logs tell them apart."""
    (estimated / "iterations/001/10-record.h5").write_bytes(b"")
    assert document("status")["artifacts"][0]["stage"] == "import"
    (estimated / "sample.csv").unlink()
    assert document("status")["artifacts"][0]["stage"] == "record"


def test_every_damaged_artifact_has_its_own_line(estimated: Path) -> None:
    """More than one: each command on a line that can be pasted. Of one alone the hint says it."""
    spoil(estimated / ESTIMATE)
    assert "one by one" not in invoke("status", "--check").stderr
    (estimated / "floor.h5").write_bytes(b"")
    lines = invoke("status", "--check").stderr.splitlines()
    at = lines.index("to mend what is damaged, one by one:")
    assert lines[at + 1 : at + 3] == ["  r2s2r floor", f"  r2s2r recover {ESTIMATE}"]
    assert "one by one" not in invoke("status", "--quiet").stderr

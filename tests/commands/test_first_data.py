"""A project without data is told one command that brings some, and that command names what is there."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.reached import ROBOT
from r2s2r_cli.store import log_folders
from r2s2r_cli.store.first_data import first_data
from schemas.config import LinkSettings
from tests.commands.conftest import document, invoke

RECORD = "r2s2r record --random 15 --repeats 3"


def hint(*typed: str) -> str:
    """Of a command that is refused."""
    refused = invoke(*typed)
    assert refused.exit_code in (2, 4), refused.output
    return str(refused.stderr.splitlines()[-1].removeprefix("hint: "))


@pytest.mark.parametrize("command", ["import", "identify", "diagnose", "compare", "floor", "estimate"])
def test_a_log_that_lies_there_is_named(project: Path, command: str) -> None:
    """Pasted, the command brings data; a bench measurement beside it is none."""
    (project / "points.csv").write_text("set,sensor_id,length_mm,capacitance_pF\n")
    said = hint(command)
    assert said in ("r2s2r import sample.csv", "r2s2r import sample.csv --iteration 1")
    assert invoke(*shlex.split(said)[1:], "--no-draw").exit_code == 0


def test_without_a_log_the_robot_is_recorded(project: Path) -> None:
    """No file is named that is not there, by any command that needs data."""
    (project / "sample.csv").unlink()
    for command in ("import", "diagnose", "compare", "floor", "estimate"):
        assert hint(command) == f"{RECORD} {ROBOT}"
    assert document("status")["next"] == f"{RECORD} {ROBOT}"
    assert hint("run") == f"r2s2r run {ROBOT}"
    assert hint("identify") == f"{RECORD} --iteration 1 {ROBOT}"


def test_a_log_in_the_working_folder_counts(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From elsewhere the project is named as well; several logs are all said."""
    elsewhere = project.parent / "logs"
    elsewhere.mkdir()
    for name in ("a b.csv", "z.csv"):
        shutil.copy(project / "sample.csv", elsewhere / name)
    (project / "sample.csv").unlink()
    monkeypatch.chdir(elsewhere)
    assert hint("import", "--project", str(project)) == "r2s2r import 'a b.csv' --project ../robot   # or z.csv"


@pytest.mark.parametrize("folder", log_folders.USUAL)
def test_a_log_in_a_folder_of_logs_is_named(project: Path, folder: str) -> None:
    """Where the project's own folder has none; pasted, the command brings data."""
    (project / folder).mkdir()
    for name in ("sample.csv", "sample.toml"):
        (project / name).rename(project / folder / name)
    assert hint("estimate") == f"r2s2r import {folder}/sample.csv"
    assert hint("run") == f"r2s2r run {folder}/sample.csv"
    assert invoke("import", f"{folder}/sample.csv", "--no-draw").exit_code == 0


def test_few_files_of_a_folder_are_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hint does not read through a folder of many thousands: as many as are said are listed, and no more opened."""
    monkeypatch.setattr(log_folders, "MOST_FILES", 5)
    for number in range(9):
        (tmp_path / f"{number}.csv").write_text("no log\n")
    opened: list[str] = []
    really = Path.open

    def counted(path: Path, *how: Any, **more: Any) -> Any:
        opened.append(path.name)
        return really(path, *how, **more)

    monkeypatch.setattr(Path, "open", counted)
    assert first_data(tmp_path, here=tmp_path).startswith(RECORD)
    assert len(opened) == 5 and log_folders.some_files(tmp_path / "none", ".csv") == []


def test_a_robot_that_the_project_knows_is_not_named_again(tmp_path: Path) -> None:
    """A rig has a camera of its own."""
    for port, options in (("", ROBOT), ("udp://0.0.0.0:2390", "--camera realsense"),
                          ("socket://127.0.0.1:4000", "--camera rig://127.0.0.1:9000")):  # fmt: skip
        assert first_data(tmp_path, LinkSettings(port=port), here=tmp_path) == f"{RECORD} {options}"


def test_a_new_project_says_what_is_typed_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the sample its log, else the robot."""
    monkeypatch.chdir(tmp_path)
    assert invoke("init", "one").stderr.splitlines()[-1] == f"hint: cd one && {RECORD} {ROBOT}"
    assert invoke("init", "two", "--sample").stderr.splitlines()[-1] == "hint: cd two && r2s2r import sample.csv"


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("import sampel.csv --no-draw", "r2s2r import sampel.csv --no-draw"),
        ("import nature.csv", "ls ."),
    ],
)
def test_a_misspelt_log_is_mended_in_the_command(
    project: Path, monkeypatch: pytest.MonkeyPatch, typed: str, said: str
) -> None:
    """Where one is near; that all logs end with .csv makes no two of them alike."""
    monkeypatch.setattr("sys.argv", ["r2s2r", *typed.split()])
    assert hint(*typed.split()) == said.replace("sampel", "sample")
    assert ("did you mean" in invoke(*typed.split()).stderr) == ("sampel" in typed)

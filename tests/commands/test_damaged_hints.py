"""An artifact with nothing of ours in it: every command names the one that makes it again, and that one works."""

from __future__ import annotations

import errno
import shlex
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.store.again import command_at
from r2s2r_cli.store.imported import GUESSED
from tests.commands.conftest import document, invoke

ESTIMATE = "iterations/001/20-estimate.h5"
RECORDING = "iterations/001/10-record.h5"


@pytest.mark.parametrize("content", [b"", b"not of ours", b"\x89HDF\r\n\x1a\n" + bytes(100)])
@pytest.mark.parametrize(
    "command", ["status", f"inspect {ESTIMATE}", f"recover {ESTIMATE}", f"validate {ESTIMATE}", "identify"]
)
def test_the_hint_makes_it_again(estimated: Path, content: bytes, command: str) -> None:
    """Of an empty file and a foreign one; pasted, the hint writes the artifact."""
    if command.startswith("inspect") and content.startswith(b"\x89HDF"):
        command += " --same-as iterations/001/10-record.h5"  # the tree of a foreign file is shown, no error
    (estimated / ESTIMATE).write_bytes(content)
    last = invoke(*command.split()).stderr.splitlines()[-1]
    assert last == "hint: r2s2r estimate --iteration 1"
    assert invoke(*shlex.split(last)[2:], "--no-draw").exit_code == 0
    assert document("status")["artifacts"][1]["state"] == "fresh"


@pytest.mark.parametrize("command", ["status", f"inspect {ESTIMATE}", f"validate {ESTIMATE}", "identify"])
def test_what_was_cut_off_is_made_again(estimated: Path, command: str) -> None:
    """Its numbers are gone: at once by its stage, not first by `recover`, which is for a recording of a robot, or of
    logs that are not there any more."""
    again = "r2s2r import sample.csv --iteration 1 --force"
    for name, mended in ((ESTIMATE, "r2s2r estimate --iteration 1"), (RECORDING, again)):
        whole = (estimated / name).read_bytes()
        (estimated / name).write_bytes(whole[:-2000])
        typed = command.replace(ESTIMATE, name)
        last = invoke(*typed.split()).stderr.splitlines()[-1]
        assert last.replace(f"{estimated}/", "") == f"hint: {mended}"
        assert invoke(*shlex.split(last)[2:], "--no-draw").exit_code == 0
    (estimated / RECORDING).write_bytes((estimated / RECORDING).read_bytes()[:-2000])
    (estimated / "sample.csv").unlink()
    last = invoke(*command.replace(ESTIMATE, RECORDING).split()).stderr.splitlines()[-1]
    assert last.replace(f"{estimated}/", "") == f"hint: r2s2r recover {RECORDING}"


def test_what_was_cut_off_is_made_as_it_was(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the options that its head has, in the project's directory; elsewhere by its place alone."""
    assert invoke("estimate", "--set", "estimate.sensor_gap_s=0.2", "--no-draw").exit_code == 0
    path = estimated / ESTIMATE
    path.write_bytes(path.read_bytes()[:-2000])
    assert document("status")["next"] == "r2s2r estimate --set estimate.sensor_gap_s=0.2 --iteration 1"
    monkeypatch.chdir(estimated.parent)
    last = invoke("inspect", f"robot/{ESTIMATE}").stderr.splitlines()[-1]
    assert last == "hint: r2s2r estimate --iteration 1 --project robot"


def test_what_may_not_be_read_is_shown(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`recover` could not read it either: the hint shows whose it is, and does not make it again over what is whole."""
    really = Path.open

    def forbidden(path: Path, *how: Any, **more: Any) -> Any:
        if path.name == Path(ESTIMATE).name:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return really(path, *how, **more)

    monkeypatch.setattr(Path, "open", forbidden)
    answer = document("status")
    assert [one["state"] for one in answer["artifacts"]] == ["fresh", "damaged"]
    assert answer["artifacts"][1]["reasons"] == ["the file cannot be read"]
    assert answer["next"] == f"ls -la {estimated / ESTIMATE}"


def test_what_may_be_brought_back_is_recovered(estimated: Path) -> None:
    """A damaged head before whole data."""
    with (estimated / ESTIMATE).open("r+b") as file:
        file.write(b"xxxx")
    assert document("status")["next"] == f"r2s2r recover {ESTIMATE}"
    assert invoke("identify").stderr.splitlines()[-1] == f"hint: r2s2r recover {estimated / ESTIMATE}"
    assert invoke("recover", ESTIMATE).exit_code == 0


@pytest.mark.parametrize(
    "command",
    ["status", "estimate", "recover", f"recover {RECORDING}", f"inspect {RECORDING}", f"validate {RECORDING}"],
)
def test_an_empty_recording_is_imported_again(estimated: Path, command: str) -> None:
    """Its logs are guessed by the names of its runs, and the hint says that; pasted, it brings the recording back. It
    comes before a stage that reads it and stands first in the list."""
    (estimated / "floor.h5").write_bytes(b"")
    (estimated / RECORDING).write_bytes(b"")
    last = invoke(*command.split()).stderr.splitlines()
    hints = [line for line in last if line.startswith("hint: r2s2r import")]
    assert hints[-1:] == [f"hint: r2s2r import sample.csv --iteration 1 --force   # {GUESSED}"]
    assert command == "recover" or hints[-1] == last[-1]
    assert invoke(*shlex.split(hints[0], comments=True)[2:], "--no-draw").exit_code == 0
    assert invoke("validate", RECORDING).exit_code == 0


@pytest.mark.parametrize("folder", ["data", "logs", "recordings", "../shelf"])
def test_its_log_is_found_where_logs_are_kept(estimated: Path, folder: str) -> None:
    """Beside the project's folder the usual ones are looked at, and those that another recording was imported from;
    pasted, the command works."""
    place = estimated / folder
    place.mkdir()
    for name in ("sample.csv", "sample.toml"):
        (estimated / name).rename(place / name)
    if folder == "../shelf":
        second = place / "second.csv"
        second.write_bytes((place / "sample.csv").read_bytes())
        second.with_suffix(".toml").write_bytes((place / "sample.toml").read_bytes())
        assert invoke("import", f"{folder}/second.csv", "--iteration", "2", "--no-draw").exit_code == 0
    (estimated / RECORDING).write_bytes(b"")
    said = document("status")
    again = f"r2s2r import {folder}/sample.csv --iteration 1 --force   # {GUESSED}"
    assert again in [said["next"], *(one["mend"] for one in said["artifacts"])]
    assert invoke(*shlex.split(again, comments=True)[1:], "--no-draw").exit_code == 0


def test_a_log_that_was_moved_is_known_by_its_bytes(estimated: Path) -> None:
    """Where the head can be read it is no guess: another log of that name is none, and the options stay."""
    tolerance = "import.rod_length_tolerance=0.06"
    assert invoke("import", "sample.csv", "--set", tolerance, "--no-draw", "--force").exit_code == 0
    (estimated / "data").mkdir()
    (estimated / "logs").mkdir()
    (estimated / "data/sample.csv").write_text("another\n")
    for name in ("sample.csv", "sample.toml"):
        (estimated / name).rename(estimated / "logs" / name)
    (estimated / RECORDING).write_bytes((estimated / RECORDING).read_bytes()[:-2000])
    again = document("status")["next"]
    assert again == f"r2s2r import logs/sample.csv --set {tolerance} --iteration 1 --force"
    assert invoke(*shlex.split(again)[1:], "--no-draw").exit_code == 0
    (estimated / RECORDING).write_bytes((estimated / RECORDING).read_bytes()[:-2000])
    (estimated / "logs/sample.csv").unlink()
    assert document("status")["next"] == f"r2s2r recover {RECORDING}"


def test_what_nobody_can_guess_is_no_command(estimated: Path) -> None:
    """No log of that name: what to do with one is said behind the command that looks. Of a robot's recording it would
    be the wrong one."""
    (estimated / "sample.csv").unlink()
    (estimated / RECORDING).write_bytes(b"")
    assert document("status")["next"] == f"r2s2r recover {RECORDING}"
    last = invoke("recover", RECORDING).stderr.splitlines()[-1]
    assert last == f"hint: file {RECORDING}   # if it was imported: r2s2r import LOG --force"


@pytest.mark.parametrize("damage", ["cut off", "changed", "empty"])
def test_import_tells_damage_from_other_runs(estimated: Path, monkeypatch: pytest.MonkeyPatch, damage: str) -> None:
    """Where the head names the logs the same ones replace it; where nothing says what it held, that is said, and
    --force is asked for."""
    whole = (estimated / RECORDING).read_bytes()
    middle = len(whole) // 2
    changed = whole[:middle] + bytes(8 * [whole[middle] ^ 255]) + whole[middle + 8 :]
    (estimated / RECORDING).write_bytes({"cut off": whole[:-2000], "changed": changed, "empty": b""}[damage])
    monkeypatch.setattr("sys.argv", ["r2s2r", "import", "sample.csv", "--no-draw"])
    result = invoke("import", "sample.csv", "--no-draw")
    if damage != "empty":
        assert result.exit_code == 0, result.stderr
        return
    assert result.exit_code == 2 and "is damaged" in result.stderr and "other runs" not in result.stderr
    assert result.stderr.splitlines()[-1] == "hint: r2s2r import sample.csv --no-draw --force"
    assert invoke("import", "sample.csv", "--no-draw", "--force").exit_code == 0


def test_the_command_of_a_place(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By name and folder, with the project where that is not here; nothing where a stage must be told more."""
    folder = estimated / "iterations/007"
    assert command_at(folder / "51-estimate.h5") == "r2s2r estimate --of execute --iteration 7"
    assert command_at(folder / "70-diagnose.h5") == "r2s2r diagnose --iteration 7"
    assert command_at(Path("floor.h5")) == "r2s2r floor"
    assert command_at(folder / "10-record.h5") == command_at(estimated / "calibration.h5") == ""
    assert command_at(estimated / "30-identify.h5") == command_at(folder / "floor.h5") == ""
    monkeypatch.chdir(estimated.parent)
    assert command_at(folder / "30-identify.h5") == "r2s2r identify --iteration 7 --project robot"
    assert command_at(Path("30-identify.h5")) == ""


def test_the_way_out_of_a_file_with_nothing_in_it_ends(estimated: Path) -> None:
    """No stage makes policies.h5 again by its name, and nothing is left in it: it goes out of the way, whole, and what
    is asked for next is another thing."""
    (estimated / "policies.h5").write_bytes(b"garbage")
    assert document("status")["next"] == "r2s2r recover policies.h5"
    last = invoke("recover", "policies.h5").stderr.splitlines()[-1]
    assert last == "hint: mv -n policies.h5 policies.h5.lost   # nothing in it can be brought back"
    (estimated / "policies.h5").rename(estimated / "policies.h5.lost")
    assert "policies" not in document("status")["next"]
    assert invoke("recover", "other.h5").stderr.splitlines()[-1].startswith("hint: ls -la")

"""A file given to the wrong command, or under a name that is nearly right: the hint is what was meant, and works."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.commands.conftest import invoke

GAIT = 'schema_version = 1\nrobot = "threebar"\nname = "gait"\n[[steps]]\ntarget = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]\n'
POINTS = "file,sensor_id,sensor,length_mm,capacitance_pF\n"


def refused(monkeypatch: pytest.MonkeyPatch, *typed: str, code: int = 4) -> str:
    """The hint of a command line that is refused, without `r2s2r`."""
    monkeypatch.setattr("sys.argv", ["r2s2r", *typed])
    result = invoke(*typed)
    assert result.exit_code == code, result.output
    hint = result.stderr.splitlines()[-1]
    assert hint.startswith("hint: r2s2r ")
    return str(hint.removeprefix("hint: r2s2r "))


@pytest.mark.parametrize(
    ("name", "text", "hint"),
    [
        ("points.csv", POINTS, "calibrate --points points.csv"),
        ("pull.csv", "curve,displacement_mm,force_N\n", "calibrate --tendons pull.csv"),
        ("robot.toml", None, "validate robot.toml"),
        ("gait.toml", GAIT, "validate gait.toml"),
        ("iterations/001/20-estimate.h5", None, "inspect iterations/001/20-estimate.h5"),
        ("history.json", '[{"m_pF_per_mm": [1]}]', "calibrate --history history.json"),
    ],
)
def test_what_is_no_log_leads_to_its_command(
    estimated: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str | None, hint: str
) -> None:
    """`import` had asked for a sidecar of a bench measurement, and to read an artifact as a table."""
    if text is not None:
        Path(name).write_text(text)
    assert refused(monkeypatch, "import", name) == hint


def test_a_log_with_other_columns_is_still_one(project: Path) -> None:
    """A trajectory that happens to have a column of that name is no bench measurement."""
    text = Path("sample.csv").read_text().splitlines()
    Path("sample.csv").write_text("\n".join([f"{text[0]},displacement_mm", *(f"{row},0" for row in text[1:])]))
    said = invoke("import", "sample.csv", "--no-draw").stderr
    assert "calibrate" not in said


@pytest.mark.parametrize("command", ["export", "migrate", "recover", "inspect"])
def test_a_text_file_is_no_artifact(project: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """One hint, not a chain of them: `validate` says what the file is, and reads it."""
    assert refused(monkeypatch, command, "robot.toml") == "validate robot.toml"
    assert invoke("validate", "robot.toml").exit_code == 0


@pytest.mark.parametrize("typed", ["policies/gait.tml", "policies/gait.toml:gait", "policies/gaits.toml"])
def test_the_policy_that_was_meant_is_named(project: Path, monkeypatch: pytest.MonkeyPatch, typed: str) -> None:
    """Pasted, the hint simulates it, with the options as typed; it had simulated a random one."""
    Path("policies").mkdir()
    Path("policies/gait.toml").write_text(GAIT)
    hint = refused(monkeypatch, "simulate", typed, "--seed", "3")
    assert hint == "simulate policies/gait.toml --seed 3"
    assert invoke(*shlex.split(hint), "--dry-run").exit_code == 0


def test_where_no_policy_is_near_none_is_named(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor where its folder is not there."""
    assert refused(monkeypatch, "simulate", "nowhere/walk.toml") == "simulate --random 15"


def test_a_project_file_is_not_corrected_into_a_world(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a world file the wrong key is named; nobody is asked to take the head out of project.toml."""
    hint = refused(monkeypatch, "rig", "--world", "project.toml")
    assert shlex.split(hint, comments=True) == ["rig", "--help"]
    Path("world.toml").write_text("[camera]\nnosuch = 1\n")
    result = invoke("rig", "--world", "world.toml")
    assert result.exit_code == 4 and result.stderr.splitlines()[-1] == "hint: correct camera.nosuch in world.toml"


def test_a_bound_is_said_without_the_words_of_a_library(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is expected, as everywhere: a value."""
    monkeypatch.setattr("sys.argv", ["r2s2r"])
    result = invoke("simulate", "--random", "3", "--set", "simulate.step_s=0")
    assert result.exit_code == 2
    assert "  expected: greater than 0" in result.stderr.splitlines()

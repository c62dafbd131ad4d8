"""`validate` given what other commands take: it says what the file is, and names the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from schemas.results import ValidateResult
from tests.commands.conftest import invoke

PART = '[[part]]\nname = "rod"\nmass_kg = 0.12\noffset_m = 0.0\nshape = "point"\n'


def outcome(*arguments: str) -> tuple[int, ValidateResult]:
    """Exit code and JSON document of `validate`."""
    result = invoke("validate", *arguments, "--json")
    return result.exit_code, ValidateResult.model_validate(json.loads(result.stdout))


@pytest.mark.parametrize(
    ("name", "text", "received", "hint"),
    [
        ("t.csv", "curve,displacement_mm,force_N\n", "tendon curves", "r2s2r calibrate --tendons t.csv"),
        ("t.csv", "Displacement_mm;force_N\n", "tendon curves", "r2s2r calibrate --tendons t.csv"),
        ("p.csv", "file,sensor_id,length_mm,capacitance_pF\n", "points of sensors", "r2s2r calibrate --points p.csv"),
        ("my p.csv", "set,sensor_id,length_mm,capacitance_F\n", "points", "r2s2r calibrate --points 'my p.csv'"),
        ("log.csv", "t_s,cap0_x_m\n", "a .csv file", "r2s2r import log.csv"),
        ("empty.csv", "", "a .csv file", "r2s2r import empty.csv"),
        ("h.json", '[{"m_pF_per_mm": [1]}]', "a history of calibrations", "r2s2r calibrate --history h.json"),
        ("x.json", "{}", "a .json file", "r2s2r import --help"),
    ],
)
def test_sources_lead_to_their_command(project: Path, name: str, text: str, received: str, hint: str) -> None:
    """Tables are told apart by their header: tendon curves and sensor points are not for import."""
    Path(name).write_text(text)
    code, document = outcome(name)
    assert code == 4
    assert document.findings[0].received.startswith(received)
    assert document.findings[0].hint == hint


def test_masses_are_checked_as_calibrate_reads_them(project: Path) -> None:
    """Weighed parts pass where calibrate takes them; a wrong value is an error in a readable file, with its line."""
    Path("masses.toml").write_text(PART)
    assert outcome("masses.toml")[0] == 0
    Path("masses.toml").write_text(PART.replace("0.12", "120"))
    code, document = outcome("masses.toml")
    assert (code, document.unreadable) == (3, ())
    assert document.findings[0].location.endswith("line 3, part 1, mass_kg")
    assert "kilograms" in document.findings[0].hint


def test_masses_outside_a_project_are_said_to_be_some(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a robot they cannot be compared: the message says what they are and what takes them."""
    monkeypatch.chdir(tmp_path)
    Path("masses.toml").write_text(PART)
    code, document = outcome("masses.toml")
    assert code == 4
    assert "measurements for calibrate" in document.findings[0].what
    assert document.findings[0].hint.startswith("r2s2r calibrate --masses masses.toml")


def test_a_value_out_of_range_is_an_error_in_a_file_that_can_be_read(project: Path) -> None:
    """3.5 for 3.5 mm: the sentence names the unit, and the file is not called unreadable."""
    text = Path("robot.toml").read_text().replace("winch_radius_m = 0.0035", "winch_radius_m = 3.5", 1)
    Path("robot.toml").write_text(text)
    result = invoke("validate", "robot.toml")
    assert result.exit_code == 3
    assert "cannot be read" not in result.stderr
    assert "at most 1 m: 3.5 looks like millimetres" in result.stdout
    assert result.stderr.count("looks like") == 1  # the last line; the remark about the robot does not repeat it

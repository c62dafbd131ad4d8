"""`r2s2r calibrate` in a project: robot.toml is edited, earlier parts are kept, nothing is chosen for the user."""

from __future__ import annotations

import shlex
import tomllib
from pathlib import Path

import pytest

from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke

SLOPE_PF_PER_MM, OFFSET_PF = 0.03, 16.0
MASSES = """
[[part]]
name = "rod"
mass_kg = 0.04
offset_m = 0.0
shape = "cylinder"
radius_m = 0.0016
length_m = 0.3
"""


@pytest.fixture
def points(project: Path) -> Path:
    """Two planted sets of nine exact lines, the second with 1 pF more."""
    rows = ["file,sensor_id,sensor,length_mm,capacitance_pF"]
    for name, extra in (("monday", 0.0), ("friday", 1.0)):
        for sensor in range(9):
            for length in (100, 120, 140, 160, 180):
                rows.append(f"{name},{sensor},S{sensor},{length},{OFFSET_PF + extra + SLOPE_PF_PER_MM * length:.4f}")
    path = project / "points.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def sensor_zero() -> dict[str, float]:
    """Sensor 0 of robot.toml."""
    found: dict[str, float] = tomllib.loads(Path("robot.toml").read_text())["sensors"][0]
    return found


def test_of_several_sets_none_is_chosen(points: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without --use robot.toml stays as it is, byte for byte; the hint names the sets with how well each fits, and
    chooses none: pasted as it is, it is refused with the same choice."""
    before = Path("robot.toml").read_bytes()
    typed = ["calibrate", "--points", "points.csv", "--no-draw"]
    monkeypatch.setattr("sys.argv", ["r2s2r", *typed])
    result = invoke(*typed)
    assert result.exit_code == 0
    assert Path("robot.toml").read_bytes() == before
    mended = shlex.split(result.stderr.splitlines()[-1], comments=True)[2:]
    known = "monday (0.0 mm rms) | friday (0.0 mm rms)"
    assert mended == [*typed, "--use", "SET"] and f"   # SET: {known}" in result.stderr
    refused = invoke(*mended)
    assert refused.exit_code == 2 and f"expected: {known}" in refused.stderr
    assert Path("robot.toml").read_bytes() == before


def test_the_chosen_set_goes_into_robot_toml(points: Path) -> None:
    """--use writes the planted line in SI, and every comment and other line survives."""
    before = Path("robot.toml").read_text().splitlines()
    assert invoke("calibrate", "--points", "points.csv", "--use", "friday", "--no-draw").exit_code == 0
    assert sensor_zero()["slope_f_per_m"] == pytest.approx(SLOPE_PF_PER_MM * 1e-9, rel=1e-3)
    assert sensor_zero()["offset_f"] == pytest.approx((OFFSET_PF + 1) * 1e-12, rel=1e-3)
    assert set(before) - set(Path("robot.toml").read_text().splitlines()) == set()


def test_a_robot_toml_without_the_numbers_is_mended(points: Path) -> None:
    """Where robot.toml was put back, or the command was killed before it was written, calibrate writes it again."""
    before = Path("robot.toml").read_text()
    command = ("calibrate", "--points", "points.csv", "--use", "friday", "--no-draw")
    assert document(*command)["state"] == "done"
    assert document(*command)["state"] == "fresh"
    Path("robot.toml").write_text(before)
    answer = document(*command)
    assert (answer["state"], answer["reasons"]) == ("done", ["robot.toml does not hold its numbers"])
    assert sensor_zero()["offset_f"] == pytest.approx((OFFSET_PF + 1) * 1e-12, rel=1e-3)


def test_a_choice_stands_until_another_is_made(points: Path) -> None:
    """Running again on the same points without --use keeps the set that was chosen."""
    assert invoke("calibrate", "--points", "points.csv", "--use", "friday", "--no-draw").exit_code == 0
    assert document("calibrate", "--points", "points.csv", "--no-draw")["state"] == "fresh"


def test_a_choice_needs_its_points(points: Path) -> None:
    """--use beside masses alone: refused with the points that it lacks, not noted down as a choice that was made; so
    that the points with it are fitted afterwards."""
    assert invoke("calibrate", "--points", "points.csv", "--no-draw").exit_code == 0
    Path("masses.toml").write_text(MASSES)
    result = invoke("calibrate", "--masses", "masses.toml", "--use", "friday", "--no-draw")
    assert result.exit_code == 2 and "r2s2r calibrate --points points.csv --use friday" in result.stderr
    assert document("calibrate", "--points", "points.csv", "--use", "friday", "--no-draw")["state"] == "done"
    assert sensor_zero()["offset_f"] == pytest.approx((OFFSET_PF + 1) * 1e-12, rel=1e-3)


def test_a_later_part_keeps_the_earlier_one(points: Path) -> None:
    """Masses given later join the sensor lines in calibration.h5; both sources are its inputs."""
    assert invoke("calibrate", "--points", "points.csv", "--no-draw").exit_code == 0
    Path("masses.toml").write_text(MASSES)
    answer = document("calibrate", "--masses", "masses.toml", "--no-draw")
    assert set(answer["inputs"]) == {"points.csv", "masses.toml"}
    _, data = read_artifact(Path("calibration.h5"), "calibration")
    assert {"lines", "masses"} <= set(data.groups)
    assert invoke("status", "--check").exit_code == 0


def test_a_changed_source_makes_it_stale(points: Path) -> None:
    """status names the file whose bytes are others."""
    assert invoke("calibrate", "--points", "points.csv", "--no-draw").exit_code == 0
    points.write_text(points.read_text() + "\n")
    result = invoke("status", "--check")
    assert result.exit_code == 3
    assert "points.csv changed" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ((), 2),
        (("--points", "absent.csv"), 4),
        (("--points", "points.csv", "--use", "mondey"), 2),
        (("--points", "project.toml"), 4),
        (("--masses", "points.csv"), 4),
    ],
)
def test_what_cannot_be_fitted_is_refused(points: Path, arguments: tuple[str, ...], code: int) -> None:
    """Nothing to do, a missing file, an unknown set, a file of another form: refused with a hint, nothing written."""
    result = invoke("calibrate", *arguments)
    assert result.exit_code == code
    assert result.stderr.splitlines()[-1].startswith("hint: ")
    assert not Path("calibration.h5").exists()

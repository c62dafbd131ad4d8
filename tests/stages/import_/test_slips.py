"""Slips of a log that can be read and would be wrong: clock, sign, controller, names; and the hints, pasted."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.control_sign import cable_response
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_ import ImportedRun, import_source
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot
from schemas.sidecar import MINIMAL_SIDECAR
from tests.support.import_samples import SIDECAR, csv_text, glide, sample_robot, small_csv, steps

ROBOT = sample_robot()
TARGETS = [[0.1, 0, 0.1, 0, 0, 0], [1, 0.1, 1, 0, 0, 0]]
KNOWN = {"sixbar": [0.325] * 6, "threebar": [0.325] * 3}


def written(folder: Path, text: str, sidecar: str = SIDECAR) -> Path:
    """`log.csv` with its sidecar."""
    (folder / "log.csv").write_text(text)
    (folder / "log.toml").write_text(sidecar)
    return folder / "log.csv"


def imported(path: Path) -> ImportedRun:
    """The run of a log."""
    return import_source(path, robot=ROBOT, known_rods=KNOWN)


def refused(path: Path) -> InputError:
    """What a log is refused with."""
    with pytest.raises(InputError) as caught:
        imported(path)
    return caught.value


def pasted(command: str) -> None:
    """Run a hint as a user would."""
    subprocess.run(["bash", "-c", command], check=True, timeout=180)


def stamped(ticks: float, *, start: float = 0.0, gap: float = 0.1) -> str:
    """Twelve frames at 10 Hz whose clock counts `ticks` a second."""
    t = np.arange(12) * gap
    lines = csv_text(t, glide(t), steps(12, TARGETS), np.zeros((12, 6))).splitlines()
    rows = [f"{round((start + s) * ticks)},{line.partition(',')[2]}" for s, line in zip(t, lines[1:], strict=True)]
    return "\n".join([lines[0], *rows]) + "\n"


@pytest.mark.parametrize("start", [0.0, 1676990000.0])
@pytest.mark.parametrize(("ticks", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_stamps_in_another_unit_are_refused_with_the_command_that_converts(
    tmp_path: Path, ticks: float, unit: str, start: float
) -> None:
    """ms, us and ns, from 0 and since 1970: named; the pasted hint converts in place, with a copy."""
    path = written(tmp_path, stamped(ticks, start=start))
    before = path.read_bytes()
    error = refused(path)
    assert error.what.endswith(f"they look like {unit}")
    pasted(error.hint)
    assert (tmp_path / "log.csv.bak").read_bytes() == before
    report = imported(path).report
    assert report.kept == 12
    assert report.frame_gap_median_s == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("name", ["t_ms", "time_ms"])
def test_a_column_that_says_milliseconds_is_converted_not_renamed(tmp_path: Path, name: str) -> None:
    """The unit is in the name: the hint converts and renames."""
    path = written(tmp_path, stamped(1e3).replace("t_s", name, 1))
    error = refused(path)
    assert error.what == "the stamps are in milliseconds"
    pasted(error.hint)
    assert imported(path).report.duration_s == pytest.approx(1.1)


@pytest.mark.parametrize("name", ["t", "time", "Time", "timestamp"])
def test_the_usual_names_of_the_stamps_are_known(tmp_path: Path, name: str) -> None:
    """`time` means t_s, and the pasted hint renames that column alone."""
    path = written(tmp_path, small_csv().replace("t_s", name, 1))
    error = refused(path)
    assert "(did you mean 't_s'?)" in error.what
    pasted(error.hint)
    assert imported(path).report.kept == 12


def test_a_slow_camera_is_no_wrong_unit(tmp_path: Path) -> None:
    """One frame every four seconds is read."""
    t = np.arange(12) * 4.0
    path = written(tmp_path, csv_text(t, glide(t), steps(12, TARGETS)))
    assert imported(path).report.kept == 12


def test_a_run_of_a_week_is_refused(tmp_path: Path) -> None:
    """Two runs in one file: the largest step between stamps is named."""
    t = np.arange(12) * 0.1
    t[6:] += 6e5
    error = refused(written(tmp_path, csv_text(t, glide(t * 0), steps(12, TARGETS))))
    assert error.what == "the run lasts longer than a day"
    assert "frame 7" in error.where


def test_too_few_frames_are_said_at_once(tmp_path: Path) -> None:
    """Four kept frames: a warning that nothing can be estimated; five: none. Minutes are named if likely."""
    for n, warned in ((4, True), (5, False)):
        t = np.arange(n) * 0.1
        report = imported(written(tmp_path, csv_text(t, glide(t), steps(n, TARGETS)))).report
        assert any("`estimate` needs at least 5" in warning for warning in report.warnings) is warned
    t = np.arange(12) * 0.1 / 60
    report = imported(written(tmp_path, csv_text(t, glide(t), steps(12, TARGETS)))).report
    assert any("in minutes" in warning for warning in report.warnings)


def test_semicolons_are_replaced_beside_the_sidecar(tmp_path: Path) -> None:
    """The pasted hint converts in place, keeping a copy: the sidecar still belongs to the file."""
    path = written(tmp_path, small_csv().replace(",", ";"))
    error = refused(path)
    assert error.received == "semicolons"
    pasted(error.hint)
    assert imported(path).report.kept == 12
    assert (tmp_path / "log.csv.bak").read_text().count(";") > 100


def test_decimal_commas_too(tmp_path: Path) -> None:
    """Semicolons between columns and commas in decimals, as spreadsheets write them."""
    path = written(tmp_path, small_csv().replace(",", ";").replace(".", ","))
    pasted(refused(path).hint)
    assert imported(path).report.kept == 12


def test_a_controller_in_millimetres_is_refused(tmp_path: Path) -> None:
    """95 and 100 are beyond any length; 9.5 and 10 (centimetres) are beyond this robot's cables; 0.095 is right."""
    for low, high in ((95, 100), (9.5, 10), (0.95, 1.0)):
        text = SIDECAR.replace("0.095", str(low)).replace("range_m = 0.1\n", f"range_m = {high}\n")
        error = refused(written(tmp_path, small_csv(), text))
        assert "min_length_m" in error.where + error.what + error.received or "range_m" in error.received
        assert "metres" in error.expected + error.hint or "millimetres" in error.expected
    assert imported(written(tmp_path, small_csv())).report.kept == 12


def breathing(sign: float) -> str:
    """A robot that grows and shrinks, with commands that fit (+1 while it shrinks), or the opposite."""
    t = np.arange(40) * 0.1
    size = 1 + 0.005 * np.sin(2 * np.pi * t / 2)
    p = glide(t, speed_m_per_s=0.0)
    p[..., :2] *= size[:, None, None]
    control = np.tile(-sign * np.sign(np.cos(2 * np.pi * (t + 0.05) / 2))[:, None], (1, 6))
    return csv_text(t, p, steps(40, TARGETS), control)


def test_negated_controls_are_warned_about(tmp_path: Path) -> None:
    """Commands that lengthen their cables name the convention; commands that shorten them do not."""
    for sign, warned in ((1.0, False), (-1.0, True)):
        report = imported(written(tmp_path, breathing(sign))).report
        assert any("+1 must reel in" in warning for warning in report.warnings) is warned


def test_the_correlation_is_odd_in_the_commands_and_silent_without_motion() -> None:
    """Planted: speed proportional to the command gives 1, its negative -1, no command or too few gaps NaN."""
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.05, 0.15, 30))
    control = rng.uniform(-1, 1, (30, 2))
    length = 0.2 - np.concatenate([np.zeros((1, 2)), np.cumsum(0.01 * control[:-1] * np.diff(t)[:, None], axis=0)])
    assert cable_response(t, length, t, control) == pytest.approx(1.0)
    assert cable_response(t, length, t, -control) == pytest.approx(-1.0)
    assert np.isnan(cable_response(t, length, t, 0 * control))
    assert np.isnan(cable_response(t[:5], length[:5], t, control))
    assert np.isnan(cable_response(t, length, t, np.full_like(control, np.nan)))


def test_the_real_crawl_has_the_right_sign(real_dir: Path, tmp_path: Path) -> None:
    """The authors' crawl: no warning about signs; the same with its control columns negated has one."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    folder = real_dir / "tribar_crawl"
    header, *rows = (line.split(",") for line in (folder / "crawl.csv").read_text().split())
    control = [i for i, name in enumerate(header) if name.startswith("control")]
    for row in rows:
        for i in control:
            row[i] = str(-float(row[i]))
    (tmp_path / "crawl.csv").write_text("\n".join(map(",".join, [header, *rows])) + "\n")
    (tmp_path / "crawl.toml").write_bytes((folder / "crawl.toml").read_bytes())
    for path, warned in ((folder / "crawl.csv", False), (tmp_path / "crawl.csv", True)):
        report = import_source(path, robot=robot).report
        assert any("+1 must reel in" in warning for warning in report.warnings) is warned


def test_an_unknown_robot_is_no_robot_to_make(tmp_path: Path) -> None:
    """A name that init does not know: the hint writes this project's robot; a known one: the project to make."""
    path = written(tmp_path, small_csv(), SIDECAR.replace('"sample"', '"tribar"'))
    error = refused(path)
    assert "init other --robot tribar" not in error.hint
    assert "sixbar, threebar" in error.hint
    pasted(error.hint.partition("#")[0])
    assert imported(path).report.kept == 12
    path = written(tmp_path, small_csv(), SIDECAR.replace('"sample"', '"sixbar"'))
    assert refused(path).hint.startswith("r2s2r init other --robot sixbar")


def test_the_example_sidecar_is_not_imported_as_it_is(tmp_path: Path) -> None:
    """The pasted hint of a missing sidecar makes a file, whose source must still be written by hand."""
    path = tmp_path / "log.csv"
    path.write_text(small_csv())
    pasted(refused(path).hint)
    assert (tmp_path / "log.toml").read_text().startswith(MINIMAL_SIDECAR.splitlines()[0])
    error = refused(path)
    assert error.what == "the sidecar's source is wrong"
    assert error.expected.startswith("the true source")

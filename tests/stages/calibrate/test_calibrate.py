"""The stage as a whole: any subset of measurements, the choice of a set, the artifact, the real figures."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.calibrate import Source, apply_changes, calibrate
from schemas.base import DIM_SIZES
from schemas.calibration import CALIBRATION
from schemas.results_calibrate import CalibrationReport
from schemas.robot import Robot
from tests.stages.calibrate.conftest import cubic_text, source

Make = Callable[..., str]
K = np.array([[80.0, -300.0, 4000.0], [90.0, -200.0, 3000.0]])
MASSES = '[[part]]\nname = "all"\nmass_kg = 0.13\noffset_m = 0.01\nshape = "sphere"\nradius_m = 0.02\n'
HISTORY = json.dumps(
    [
        {"date": f"2025-01-{day:02d}", "m_pF_per_mm": [0.03] * 9, "b_pF": [16.0 + day / 100] * 9}
        for day in (1, 2, 5)
    ]
)  # fmt: skip


@pytest.fixture
def everything(robot: Robot, points_text: Make) -> tuple[ArtifactData, CalibrationReport]:
    """All four measurements at once, a dead sensor among them."""
    return calibrate(
        robot=robot,
        points=source(points_text(sets=("a", "b"), flat=(3,))),
        history=source(HISTORY, "history.json"),
        tendons=[source(cubic_text(K), "tendons.csv")],
        masses=source(MASSES, "masses.toml"),
        use="b",
    )


def test_the_artifact_has_the_layout_of_its_schema(everything: tuple[ArtifactData, CalibrationReport]) -> None:
    """Every dataset is in the schema with its dtype, axes of one length a group, NaN only where it has a meaning."""
    data, _ = everything
    assert data.kind == "calibration"
    assert set(data.groups) == {group.path for group in CALIBRATION.groups}
    for path, group in data.groups.items():
        spec = CALIBRATION.group(path)
        assert spec is not None
        assert {d.path for d in spec.datasets if d.required} <= set(group.datasets) <= {d.path for d in spec.datasets}
        assert set(group.attributes) == {attribute.name for attribute in spec.attributes}
        sizes: dict[str, int] = dict(DIM_SIZES)
        for dataset in spec.datasets:
            array = group[dataset.path]
            assert array.dtype.kind == "S" if dataset.dtype == "str" else array.dtype == np.dtype(dataset.dtype)
            assert array.ndim == len(dataset.dims)
            assert all(sizes.setdefault(dim, size) == size for dim, size in zip(dataset.dims, array.shape, strict=True))
            if array.dtype.kind == "f" and not dataset.nan_means:
                assert np.isfinite(array).all(), dataset.path


def test_what_goes_into_the_robot(everything: tuple[ArtifactData, CalibrationReport], robot_text: str) -> None:
    """The chosen set without its dead sensor, the average tendon, the weighed parts: in the report and in the text."""
    _, report = everything
    assert report.used == "b" and report.sets[1].dead == (3,)
    assert sorted(report.changes.sensors) == [0, 1, 2, 4, 5, 6, 7, 8]
    assert report.changes.sensors[0].source == "set b, rms 0.0 mm"
    assert report.changes.tendon is not None
    assert report.changes.tendon.k1_n_per_m == pytest.approx(85.0)
    text = apply_changes(robot_text, report.changes)
    assert text.count("# calibrate: set b") == 16
    assert any("sensor 3" in warning and "dead" in warning for warning in report.warnings)


def test_the_report_is_a_json_document(everything: tuple[ArtifactData, CalibrationReport]) -> None:
    """Dead sensors give null, never NaN, and the document reads back to the same report."""
    _, report = everything
    text = report.model_dump_json()
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the document"))
    assert CalibrationReport.model_validate_json(text) == report
    assert report.sets[0].lines[3].rms_m is None


def test_equal_inputs_give_equal_artifacts(robot: Robot, points_text: Make) -> None:
    """The same table twice gives the same bytes in every dataset."""
    one, other = (calibrate(robot=robot, points=source(points_text()))[0] for _ in range(2))
    for path, group in one.groups.items():
        assert all(other.groups[path][name].tobytes() == group[name].tobytes() for name in group.datasets)


def test_one_set_is_used_and_several_are_never_guessed(robot: Robot, points_text: Make, robot_text: str) -> None:
    """A table of one set needs no choice; of two sets none is used, nothing changes, and a warning says so."""
    _, single = calibrate(robot=robot, points=source(points_text()))
    assert single.used == "one" and len(single.changes.sensors) == 9
    data, double = calibrate(robot=robot, points=source(points_text(sets=("a", "b"))))
    assert double.used is None and double.changes.empty
    assert "used" not in data.groups["lines"].attributes
    assert any("--use" in warning for warning in double.warnings)
    assert apply_changes(robot_text, double.changes) is robot_text


def test_a_wrong_choice_is_a_usage_error(robot: Robot, points_text: Make) -> None:
    """An unknown set is named with the nearest known one; --use without a table, and nothing at all, are refused."""
    with pytest.raises(UsageError, match="did you mean may_3") as caught:
        calibrate(robot=robot, points=source(points_text(sets=("may_3", "june_5"))), use="may3")
    assert caught.value.hint == "r2s2r calibrate --points points.csv --use may_3"
    with pytest.raises(UsageError, match=r"no set 'monday'\n") as caught:
        calibrate(robot=robot, points=source(points_text(sets=("may_3", "june_5"))), use="monday")
    assert caught.value.hint.startswith("r2s2r calibrate --points points.csv --use SET   # ")
    assert re.fullmatch(r"may_3 \(\d\.\d mm rms\) \| june_5 \(\d\.\d mm rms\)", caught.value.expected)
    with pytest.raises(UsageError, match="--use"):
        calibrate(robot=robot, history=source(HISTORY, "history.json"), use="a")
    with pytest.raises(UsageError, match="nothing to calibrate"):
        calibrate(robot=robot)


@pytest.mark.parametrize("what", ["points", "history", "tendons", "masses"])
def test_each_measurement_stands_alone(robot: Robot, points_text: Make, what: str) -> None:
    """Any one of the four gives its own groups and leaves the others out."""
    texts = {"points": points_text(), "history": HISTORY, "tendons": cubic_text(K), "masses": MASSES}
    given = source(texts[what], what)
    groups = {"points": {"points", "lines"}, "history": {"history", "drift"},
              "tendons": {"tendon_points", "tendons"}, "masses": {"mass_parts", "masses"}}  # fmt: skip
    if what == "tendons":
        data, _ = calibrate(robot=robot, tendons=[given])
    else:
        data, _ = calibrate(robot=robot, **{what: given})  # type: ignore[arg-type]
    assert set(data.groups) == groups[what]


def test_an_average_that_falls_is_reported_and_not_written(robot: Robot) -> None:
    """Tendons whose average falls on its range are a warning, and robot.toml keeps its stiffness."""
    _, report = calibrate(robot=robot, tendons=[source(cubic_text(np.array([[80.0, -500.0, 0.0]]), x_max=0.095))])
    assert report.tendons is not None
    assert not report.tendons.monotone and report.tendons.falls_from_m == pytest.approx(0.08)
    assert report.changes.tendon is None
    assert any("not written" in warning for warning in report.warnings)


def test_the_real_calibrations(robot: Robot, real_dir: Path) -> None:
    """Straight-line residuals of the three real sets are 1.9, 1.2 and 1.6 mm rms, no sensor is dead."""
    path = real_dir / "tribar_calibration" / "length_capacitance_points.csv"
    _, report = calibrate(robot=robot, points=Source(path.name, path.read_bytes()))
    rms = {fitted.name: round(1e3 * (fitted.rms_m or 0), 2) for fitted in report.sets}
    assert rms == {
        "beta_calibration_4.xls": 1.87, "calibration_augustin_b.xls": 1.24, "manual_calibration_2025-04.xls": 1.62
    }  # fmt: skip
    assert all(fitted.dead == fitted.falling == () for fitted in report.sets)
    slopes = [1e9 * line.slope_f_per_m for fitted in report.sets for line in fitted.lines]
    assert min(slopes) > 0.02 and max(slopes) < 0.045


def test_the_real_history(robot: Robot, real_dir: Path) -> None:
    """17 real sets: the three fits of slope zero are flagged, recalibrations within two days differ by 4-6 mm."""
    folder = real_dir / "tribar_calibration"
    points, history = folder / "length_capacitance_points.csv", folder / "calibration_history_2025.json"
    _, report = calibrate(
        robot=robot,
        points=Source(points.name, points.read_bytes()),
        history=Source(history.name, history.read_bytes()),
    )
    drift = report.history
    assert drift is not None and drift.entries == 17
    zero = [(fit.date, fit.sensor) for fit in drift.failed if fit.state == "failed fit: the slope is zero"]
    assert zero == [("2025-01-14", 6), ("2025-01-14", 7), ("2025-01-14", 8)]
    assert {fit.sensor for fit in drift.failed if fit.state.startswith("suspect")} == {3}
    assert 4e-3 < (drift.short.median_m or 0) < 6e-3
    assert {(swap.before, swap.after, swap.sensor) for swap in drift.swaps} == {
        ("2025-01-21", "2025-01-28", 3), ("2025-01-21", "2025-01-28", 4), ("2025-01-28", "2025-02-01", 4)
    }  # fmt: skip

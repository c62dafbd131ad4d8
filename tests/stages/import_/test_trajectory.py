"""Trajectory CSVs with planted truths: what is stored, what is reported, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_ import import_source
from r2s2r_cli.stages.import_.sidecar import parse_sidecar
from r2s2r_cli.stages.import_.trajectory import import_trajectory
from schemas.results_import import ImportReport
from tests.support.import_samples import ROD_M, SIDECAR, csv_text, glide, sample_robot, small_csv, steps
from tests.support.run_layout import assert_run_layout

ROBOT = sample_robot()
CYCLE = [[0.1, 0, 0.1, 0, 0, 0], [1, 0.1, 1, 0, 0, 0], [1, 1, 0.1, 0, 0, 0]]


def read(text: str, sidecar: str = SIDECAR, **more: object) -> tuple[dict[str, Group], ImportReport]:
    """Import a text."""
    stated = parse_sidecar(sidecar.encode(), "log.toml")
    return import_trajectory(text.encode(), "log", robot=ROBOT, sidecar=stated, where="log.csv", **more)  # type: ignore[arg-type]


def refusal(text: str, **more: object) -> InputError:
    """The error of a text that must be refused."""
    with pytest.raises(InputError) as caught:
        read(text, **more)  # type: ignore[arg-type]
    return caught.value


def test_every_row_is_stored_and_the_dropped_ones_are_marked() -> None:
    """Each reason is found where it was planted; positions, lines and times of all rows stay."""
    t = np.arange(20) * 0.1
    t[5] = t[4] + 0.004
    t[9] = t[3]
    p = glide(t)
    p[12, 4, 1] = np.nan
    groups, report = read(csv_text(t, p, steps(20, CYCLE)))
    caps = groups["caps"]
    assert np.flatnonzero(caps["drop_reason"] == 1).tolist() == [5]
    assert np.flatnonzero(caps["drop_reason"] == 2).tolist() == [9]
    assert np.flatnonzero(caps["drop_reason"] == 3).tolist() == [12]
    assert (report.rows, report.kept, report.dropped.total) == (20, 17, 3)
    assert (report.dropped.duplicate, report.dropped.backwards, report.dropped.not_observed) == (1, 1, 1)
    assert caps["p_WE"] == pytest.approx(p, abs=1e-8, nan_ok=True)
    assert caps["source_row"].tolist() == list(range(2, 22))
    assert any("backwards" in warning for warning in report.warnings)


def test_commands_rise_in_time_and_keep_the_rows_without_caps() -> None:
    """A row dropped for a lost cap still says what was commanded; one that runs backwards does not."""
    t = np.arange(20) * 0.1
    t[9] = t[3]
    p = glide(t)
    p[12] = np.nan
    groups, _ = read(csv_text(t, p, steps(20, CYCLE), np.zeros((20, 6))))
    commands = groups["commands"]
    assert (np.diff(commands["t"]) > 0).all()
    assert commands["t"] == pytest.approx(np.delete(t, 9))


def test_missing_targets_and_commands_are_told() -> None:
    """A NaN amid a run makes an interval more and a motor rest: each with its count and first place."""
    t = np.arange(20) * 0.1
    target, control = steps(20, CYCLE), np.zeros((20, 6))
    target[:2] = control[-2:] = np.nan  # before the policy began, after it ended: nothing is missing there
    groups, report = read(csv_text(t, glide(t), target, control))
    whole = len(groups["intervals"]["first"])
    assert not any("whole" in warning for warning in report.warnings)
    target[4, 1], control[7, 3], control[9] = np.nan, np.nan, np.nan
    groups, report = read(csv_text(t, glide(t), target, control))
    assert len(groups["intervals"]["first"]) == whole + 1
    said = [warning for warning in report.warnings if "whole" in warning]
    assert said[0].startswith("1 row has no whole target, the first at log.csv:6, column 21 (target1): each ends")
    assert f"and {whole + 1} are counted" in said[0]
    assert said[1].startswith("2 rows have no whole motor command, the first at log.csv:9, column 29 (control3): ")


def test_time_starts_at_the_first_kept_frame() -> None:
    """Stamps since 1970 become seconds of the run; gaps stay."""
    t = np.arange(10) * 0.1
    groups, report = read(csv_text(t + 1000.5, glide(t), steps(10, CYCLE)))
    assert groups["caps"]["t"] == pytest.approx(t, abs=1e-5)
    assert report.duration_s == pytest.approx(0.9, abs=1e-5)


@pytest.mark.parametrize("unit", ["m", "dm", "cm", "mm"])
def test_the_unit_that_the_header_states_is_converted(unit: str) -> None:
    """The same motion in four units, said so in the column names, gives the same recording in metres."""
    t = np.arange(10) * 0.1
    length = np.full((10, 9), 0.123)
    groups, report = read(csv_text(t, glide(t), steps(10, CYCLE), length=length, unit=unit))
    assert report.unit == unit
    assert groups["caps"]["p_WE"] == pytest.approx(glide(t), abs=1e-8)
    assert groups["sensors"]["length"] == pytest.approx(length, abs=1e-8)
    assert groups["caps"]["rod_length"] == pytest.approx(np.full(3, ROD_M), abs=1e-7)


@pytest.mark.parametrize(("unit", "word"), [("dm", "decimetres"), ("cm", "centimetres"), ("mm", "millimetres")])
def test_a_unit_that_the_header_denies_is_named_and_refused(unit: str, word: str) -> None:
    """Decimetres called metres are not converted: the message names the unit, the hint renames the columns."""
    t = np.arange(10) * 0.1
    error = refusal(csv_text(t, glide(t), steps(10, CYCLE), unit=unit, header_unit="m"))
    assert word in error.what
    assert f"1s/_m,/_{unit},/g" in error.hint


def test_the_hint_of_a_wrong_unit_works(tmp_path: Path) -> None:
    """The pasted sed command makes the file importable."""
    import shutil
    import subprocess

    if shutil.which("sed") is None:
        pytest.skip("no sed on this machine")
    t = np.arange(10) * 0.1
    path = tmp_path / "log.csv"
    path.write_text(csv_text(t, glide(t), steps(10, CYCLE), unit="dm", header_unit="m"))
    (tmp_path / "log.toml").write_text(SIDECAR)
    with pytest.raises(InputError) as caught:
        import_source(path, robot=ROBOT)
    subprocess.run(["sh", "-c", caught.value.hint], check=True)
    assert import_source(path, robot=ROBOT).report.unit == "dm"


def test_metres_called_millimetres_are_refused_too() -> None:
    """The trap is symmetric: a header that says mm over metres is named as well."""
    t = np.arange(10) * 0.1
    assert (
        "in metres, the columns say millimetres"
        in refusal(csv_text(t, glide(t), steps(10, CYCLE), unit="m", header_unit="mm")).what
    )


def test_another_robot_is_named_where_its_rods_fit() -> None:
    """A 6 % shorter rod is refused at 5 % tolerance, and the robot whose rods fit best is named; 4 % passes."""
    t = np.arange(10) * 0.1
    near = {"short": [0.94 * ROD_M] * 3, "long": [0.99 * ROD_M] * 3, "six": [0.94 * ROD_M] * 6}
    error = refusal(csv_text(t, 0.94 * glide(t), steps(10, CYCLE)), known_rods=near)
    assert "fit robot short" in error.what
    assert error.hint == "r2s2r init other --robot short"
    read(csv_text(t, 0.96 * glide(t), steps(10, CYCLE)))
    read(csv_text(t, 0.94 * glide(t), steps(10, CYCLE)), rod_length_tolerance=0.1)


def test_rods_that_are_not_rigid_are_reported() -> None:
    """A rod that stretches by 20 mm (sd) is imported with a warning that names it."""
    rng = np.random.default_rng(0)
    t = np.arange(200) * 0.1
    p = glide(t)
    p[:, 3, 2] += rng.normal(0.0, 0.03, 200)
    _, report = read(csv_text(t, p, steps(200, CYCLE)))
    assert [warning for warning in report.warnings if warning.startswith("rod 1 is not rigid")]
    assert not [warning for warning in report.warnings if warning.startswith("rod 0")]


def test_noise_ground_and_jitter_come_back_as_planted() -> None:
    """2 mm of noise, a plane 4 mm low, 20 ms of jitter: all three are reported, and stored beside the caps."""
    rng = np.random.default_rng(1)
    t = np.cumsum(0.1 + rng.normal(0, 0.02, 2000).clip(-0.06, 0.06))
    p = glide(t, height_m=-0.004) + rng.normal(0, 0.002, (2000, 6, 3))
    groups, report = read(csv_text(t, p, steps(2000, CYCLE)))
    assert report.noise is not None
    assert report.noise.median_m == pytest.approx(0.002, rel=0.05)
    assert groups["caps"]["noise_sd"] == pytest.approx(np.array(report.noise.sd_m))
    # The lowest of three equally high noisy caps lies 0.846 sd below them.
    assert report.ground_offset_m == pytest.approx(0.004 + 0.846 * 0.002, abs=1e-4)
    assert report.stamp_jitter_s == pytest.approx(0.02, rel=0.05)
    assert report.noise.held == ()


def test_a_held_coordinate_is_named() -> None:
    """A coordinate that a tracker clamps is left out of the noise range and named."""
    rng = np.random.default_rng(2)
    t = np.arange(300) * 0.1
    p = glide(t) + rng.normal(0, 0.002, (300, 6, 3))
    p[:, 0, 2] = 0.0175
    _, report = read(csv_text(t, p, steps(300, CYCLE)))
    assert report.noise is not None
    assert report.noise.held == ("cap0 z",)
    assert report.noise.low_m > 0.001


def test_intervals_and_segments_are_counted_over_kept_frames() -> None:
    """A target seen in dropped rows only makes no interval."""
    t = np.arange(31) * 0.1
    t[15] = t[14] + 0.005
    target = steps(31, CYCLE)
    target[15] = [0, 0, 0, 1, 1, 1]
    control = np.ones((31, 6))
    control[20:25, 2] = -1
    groups, report = read(csv_text(t, glide(t), target, control))
    kept = target[groups["caps"]["drop_reason"] == 0]
    changes = int((kept[1:] != kept[:-1]).any(axis=1).sum())
    assert report.intervals == changes + 1 == 3
    assert report.segments > report.intervals
    assert report.intervals_complete == 2
    assert any("cut off" in warning for warning in report.warnings)


def test_sidecar_facts_are_stored() -> None:
    """Controller, source, nature and stated noise become attributes with the names of the layout."""
    groups, report = read(small_csv(), "noise_sd_m = 0.003\nstart_unix_s = 1676990000.0\n" + SIDECAR)
    attributes = groups[""].attributes
    assert attributes["pid_min_length"] == 0.095
    assert attributes["pid_range"] == 0.1
    assert attributes["motor_speed"] == 0.8
    assert attributes["nature"] == report.nature == "kinematic sample"
    assert attributes["start_unix"] == 1676990000.0
    assert groups["caps"].attributes["noise_sd_stated"] == report.noise_sd_stated_m == 0.003
    _, silent = read(small_csv(), 'robot = "sample"\nsource = "x"\n')
    assert silent.nature == "not stated"
    assert any("nature" in warning for warning in silent.warnings)


def test_lengths_of_some_cables_say_which() -> None:
    """Length columns need not be complete; the cable of each is stored."""
    lines = small_csv().splitlines()
    text = "\n".join(
        [lines[0] + ",length8_m,length2_m", *(line + f",0.{i},nan" for i, line in enumerate(lines[1:], 10))]
    )
    groups, report = read(text)
    assert groups["sensors"]["cable"].tolist() == [2, 8]
    assert groups["sensors"]["length"][:, 1] == pytest.approx(np.arange(10, 22) / 100)
    assert np.isnan(groups["sensors"]["length"][:, 0]).all()
    assert report.streams == {"caps": 12, "commands": 12, "sensors": 12}


def test_a_hole_is_reported_with_its_place() -> None:
    """A second without frames stands in the report."""
    t = np.arange(30) * 0.1
    t[12:] += 1.0
    _, report = read(csv_text(t, glide(t), steps(30, CYCLE)))
    assert [(gap.after_s, gap.length_s) for gap in report.gaps] == [pytest.approx((1.1, 1.1))]


def test_targets_within_a_hole_of_the_caps_are_told() -> None:
    """One cap is hidden while two other targets hold: they are no intervals, the two of the same target around them
    are not one, and the first of them has no key frame."""
    t = np.arange(40) * 0.1
    caps, target = glide(t), steps(40, [CYCLE[0], CYCLE[1], CYCLE[2], CYCLE[0]])
    caps[8:33, 0] = np.nan
    groups, report = read(csv_text(t, caps, target))
    assert report.intervals == 2 and groups["intervals"]["complete"].tolist() == [False, False]
    assert groups["intervals"]["t_last"].tolist() == pytest.approx([0.7, 3.9])
    (said,) = [warning for warning in report.warnings if "came and went" in warning]
    assert said.startswith("2 targets") and "from 0.70 to 3.30 s" in said


def test_a_table_height_is_a_warning_and_a_turned_frame_is_refused() -> None:
    """A ground 0.7 m up is a frame with z up; one with y up is not, whichever way the robot moves."""
    t = np.arange(40) * 0.1
    _, report = read(csv_text(t, glide(t, height_m=0.7), steps(40, CYCLE)))
    assert any("far from 0" in warning for warning in report.warnings)
    p = glide(t, turn_rad_per_s=0.5)
    turned = np.stack([p[..., 0], p[..., 2], -p[..., 1]], axis=-1)
    error = refusal(csv_text(t, turned, steps(40, CYCLE)))
    assert "(y is up)" in error.what
    # The rotation of the hint brings z up again.
    assert error.hint.endswith("x, y, z <- x, -z, y")
    read(csv_text(t, np.stack([turned[..., 0], -turned[..., 2], turned[..., 1]], axis=-1), steps(40, CYCLE)))


def test_groups_and_datasets_are_those_of_the_layout() -> None:
    """Every group, dataset and attribute is in the schema with its type, and nothing required is missing."""
    groups, _ = read(csv_text(np.arange(9) * 0.1, glide(np.arange(9) * 0.1), steps(9, CYCLE), np.zeros((9, 6)),
                              length=np.ones((9, 9))))  # fmt: skip
    assert_run_layout(groups)


def test_import_is_repeatable() -> None:
    """The same bytes give the same arrays."""
    first, second = read(small_csv()), read(small_csv())
    assert first[1] == second[1]
    for stream, group in first[0].items():
        for name in group.datasets:
            assert np.array_equal(group[name], second[0][stream][name], equal_nan=group[name].dtype.kind == "f")


def test_real_crawl(real_dir: Path) -> None:
    """The real crawl: 11 complete target intervals, 71 of 202 frames duplicates, noise 1-4 mm, ground 4 mm off."""
    report = import_source(real_dir / "tribar_crawl" / "crawl.csv", robot=sample_like_threebar()).report
    assert (report.rows, report.kept, report.dropped.duplicate, report.dropped.total) == (202, 131, 71, 71)
    assert (report.intervals, report.intervals_complete, report.segments) == (11, 11, 11)
    assert report.noise is not None
    assert (round(1e3 * report.noise.low_m), round(1e3 * report.noise.high_m)) == (1, 3)
    assert report.noise.held == ("cap5 z",)
    assert report.ground_offset_m == pytest.approx(0.004, abs=5e-4)
    assert report.nature == "not stated"


def sample_like_threebar():  # type: ignore[no-untyped-def]
    """The sample robot under the name of the real one, in its handedness."""
    robot = sample_robot(name="threebar")
    mirrored = tuple((x, -y, z) for x, y, z in robot.rest_caps_m)
    return robot.model_copy(update={"rest_caps_m": mirrored})

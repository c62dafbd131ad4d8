"""Measured numbers go into the text of robot.toml; nothing else in it changes."""

from __future__ import annotations

import difflib
import tomllib

import pytest

from r2s2r_cli.errors import InputError, NumericalError
from r2s2r_cli.stages.calibrate import apply_changes, with_parts, with_sensor_line, with_tendon
from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.results_calibrate import PartsChange, RobotChanges, SensorChange, TendonChange
from schemas.robot import Lump, Robot

LINES = {i: (3.1e-11 + i * 1e-13, 1.6e-11) for i in range(9)}


def load(text: str) -> Robot:
    """The robot of a text."""
    return Robot.model_validate(tomllib.loads(text))


def comments(text: str) -> list[str]:
    """What stands behind every # of a text (no string of robot.toml holds one)."""
    return [line.split("#", 1)[1].strip() for line in text.splitlines() if "#" in line]


def changed(old: str, new: str) -> tuple[list[str], list[str]]:
    """Lines that went, lines that came."""
    diff = list(difflib.ndiff(old.splitlines(), new.splitlines()))
    return [row[2:] for row in diff if row.startswith("- ")], [row[2:] for row in diff if row.startswith("+ ")]


def test_sensor_lines_are_added_below_their_sensor(robot_text: str) -> None:
    """Two lines a sensor come, none goes, and the robot reads them back to seven digits."""
    text = with_sensor_line(robot_text, LINES, source="set may 3, rms 1.2 mm")
    gone, came = changed(robot_text, text)
    assert gone == [] and len(came) == 18
    assert all(line.endswith("  # calibrate: set may 3, rms 1.2 mm") for line in came)
    for i, sensor in enumerate(load(text).sensors):
        assert sensor.slope_f_per_m == pytest.approx(LINES[i][0], rel=1e-6)
        assert sensor.offset_f == pytest.approx(LINES[i][1], rel=1e-6)
    after = load(text).model_copy(update={"sensors": load(robot_text).sensors})
    assert after == load(robot_text)


def test_a_new_key_stays_above_the_comments_of_the_next_table(robot_text: str) -> None:
    """The last sensor's new lines stand in its block, not under the heading of the table that follows."""
    lines = with_sensor_line(robot_text, {8: (3e-11, 1e-11)}).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("slope_f_per_m"))
    assert lines[at - 1].startswith("stiffness_n_per_m") and lines[at + 2] == ""


def test_a_second_calibration_replaces_the_first(robot_text: str) -> None:
    """Value and source are exchanged in place; the same calibration twice changes nothing."""
    once = with_sensor_line(robot_text, LINES, source="set a")
    again = with_sensor_line(once, {4: (4e-11, 1.5e-11)}, source="set b")
    gone, came = changed(once, again)
    assert len(gone) == len(came) == 2 and all("# calibrate: set b" in line and "set a" not in line for line in came)
    assert with_sensor_line(once, LINES, source="set a") == once


def test_tendons_go_to_passive_cables_and_old_comments_stay_behind(robot_text: str) -> None:
    """All three coefficients of every passive cable, none of an actuated one; every old comment is still there."""
    text = with_tendon(robot_text, 80.0, -300.0, 4000.0, x_max=0.1, source="mean of 11 tendon curves")
    for old, new in zip(load(robot_text).cables, load(text).cables, strict=True):
        if old.kind == "actuated":
            assert new == old
        else:
            assert (new.stiffness_n_per_m, new.stiffness2_n_per_m2, new.stiffness3_n_per_m3) == (80.0, -300.0, 4000.0)
            assert new.rest_length_m == old.rest_length_m
    left = iter(comments(text))
    assert all(any(old in new for new in left) for old in comments(robot_text))
    assert "before: [R2] 10000" in text or "| before: " in text
    twice = with_tendon(text, 81.0, -300.0, 4000.0, source="mean of 12 tendon curves")
    assert twice.count("| before: ") == text.count("| before: ") and "of 11" not in twice


@pytest.mark.parametrize("k", [(0.0, 1.0, 1.0), (-5.0, 1.0, 1.0), (80.0, -1000.0, 4000.0), (float("nan"), 0.0, 0.0)])
def test_a_curve_that_falls_is_not_written(robot_text: str, k: tuple[float, float, float]) -> None:
    """An average without stiffness at rest, or falling on its range, is a numerical failure, not a robot."""
    with pytest.raises(NumericalError, match="rise"):
        with_tendon(robot_text, *k, x_max=0.1)


PARTS = (
    Lump(name="cap_even", mass_kg=0.011, offset_m=-0.1625, shape="sphere", radius_m=0.0175),
    Lump(name="board", mass_kg=0.0381, offset_m=0.012, shape="point"),
    Lump(name="rod", mass_kg=0.0038, offset_m=0.0, shape="cylinder", radius_m=0.0016, length_m=0.325),
)


@pytest.mark.parametrize("rod", ["red", "green", "blue", None])
def test_parts_are_replaced_on_the_rod_that_was_weighed(robot_text: str, rod: str | None) -> None:
    """The rod has exactly the weighed parts; the others are as before; doing it again changes nothing."""
    text = with_parts(robot_text, rod, PARTS, source="weighed, masses")
    for old, new in zip(load(robot_text).rods, load(text).rods, strict=True):
        if rod in (None, old.name):
            assert {part.name: part for part in new.parts} == {part.name: part for part in PARTS}
        else:
            assert new == old
    assert with_parts(text, rod, PARTS, source="weighed, masses") == text
    kept = [line for line in robot_text.splitlines() if line.startswith("#")]
    assert all(line in text.splitlines() for line in kept)


def test_parts_with_other_names_replace_all(robot_text: str) -> None:
    """No old part is left, and the text is still the robot's, whatever the number of new parts."""
    for n in (1, 5, 12):
        parts = tuple(PARTS[1].model_copy(update={"name": f"lump {i}"}) for i in range(n))
        text = with_parts(robot_text, "green", parts)
        assert load(text).rods[1].parts == parts
        assert load(text).rods[0] == load(robot_text).rods[0] and load(text).cables == load(robot_text).cables


def test_a_part_that_keeps_its_name_keeps_its_comments(robot_text: str) -> None:
    """A part weighed anew: the mass changes, its unchanged lines stay to the letter."""
    old = load(robot_text).rods[0].parts
    new = (old[0].model_copy(update={"mass_kg": 0.0111}), *old[1:])
    gone, came = changed(robot_text, with_parts(robot_text, "red", new, source="weighed"))
    assert len(gone) == len(came) == 1
    assert "mass_kg = 0.0111  # calibrate: weighed | before: " in came[0]


def test_parts_as_inline_tables(robot_text: str) -> None:
    """A robot.toml that lists parts in braces keeps that manner."""
    head, _, tail = robot_text.partition("  [[rods.parts]]")
    rest = tail[tail.index("\n[[rods]]") :]
    inline = 'parts = [{name = "all", mass_kg = 0.1, offset_m = 0.0, shape = "point"}]\n'
    text = with_parts(head + inline + rest, "red", PARTS, source="weighed")
    assert load(text).rods[0].parts == PARTS


@pytest.mark.parametrize("name", FACTS)
def test_every_robot_takes_every_change(name: str) -> None:
    """All robots of `init`: a full calibration keeps every comment, and an empty one returns the text itself."""
    text = robot_toml(name)
    robot = load(text)
    changes = RobotChanges(
        sensors={
            i: SensorChange(slope_f_per_m=3e-11, offset_f=1.6e-11, source="set a") for i in range(len(robot.sensors))
        },
        tendon=TendonChange(k1_n_per_m=80.0, k2_n_per_m2=1.0, k3_n_per_m3=2.0, source="mean of 11 tendon curves"),
        rods={robot.rods[-1].name: PartsChange(parts=robot.rods[-1].parts, source="weighed")},
    )
    new = apply_changes(text, changes)
    left = iter(comments(new))
    assert all(any(old in line for line in left) for old in comments(text))
    assert all(sensor.slope_f_per_m == 3e-11 for sensor in load(new).sensors)
    assert apply_changes(text, RobotChanges()) is text
    assert apply_changes(new, changes) == new


def test_a_line_break_in_a_set_name_cannot_break_the_file(robot_text: str) -> None:
    """Names come from files: control characters in them do not reach the comment."""
    text = with_sensor_line(robot_text, {0: (3e-11, 1e-11)}, source='set "a\n[pid]\x00\t"')
    assert load(text).sensors[0].slope_f_per_m == 3e-11
    assert '# calibrate: set "a [pid]  "' in text


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "not valid"),
        ("a = [", "not valid TOML"),
        ("schema_version = 1", "not valid"),
        ("[" * 5000, "not valid TOML"),
    ],
)
def test_a_text_that_is_no_robot_is_refused(text: str, what: str) -> None:
    """Broken or incomplete robot.toml: an error with a place, never a traceback."""
    with pytest.raises(InputError, match=what) as caught:
        with_sensor_line(text, {0: (3e-11, 1e-11)})
    assert caught.value.where.startswith("robot.toml") and caught.value.hint


def test_what_the_robot_lacks_is_named(robot_text: str) -> None:
    """A sensor, a rod that is not there, numbers that are none: refused."""
    with pytest.raises(InputError, match="lacks"):
        with_sensor_line(robot_text, {9: (3e-11, 1e-11)})
    with pytest.raises(InputError, match="lacks"):
        with_parts(robot_text, "yellow", PARTS)
    with pytest.raises(InputError, match="not a finite number"):
        with_sensor_line(robot_text, {0: (float("nan"), 1e-11)})

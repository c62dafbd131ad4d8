"""The robot descriptions: they load, add up, name their sources, and can be edited in place."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.init.attachment import MODES, Mode, rod_frames, site_points
from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.init import init_texts
from r2s2r_cli.stages.init.robot_facts import Fact
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

NAMES = sorted(FACTS)
DOCS = Path(__file__).resolve().parents[3] / "docs"
GRAMS = {"threebar": 133.4, "threebar-330": 242.9, "sixbar": 133.4}


def load(text: str) -> Robot:
    """The robot in a TOML text."""
    return Robot.model_validate(tomllib.loads(text))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", NAMES)
def test_loads_as_a_robot(name: str, mode: Mode) -> None:
    """Every robot, with either attachment, is a valid robot description of that name."""
    robot = load(robot_toml(name, mode))
    assert (robot.name, robot.attachment) == (name, mode)
    assert robot.illustrative == (name == "sixbar")
    assert len(robot.motors) == len(robot.actuated)


@pytest.mark.parametrize("name", NAMES)
def test_rods_weigh_what_was_measured(name: str) -> None:
    """The parts of each rod add up to the published mass and balance in the rod's middle."""
    for rod in load(robot_toml(name)).rods:
        assert sum(part.mass_kg for part in rod.parts) * 1e3 == pytest.approx(GRAMS[name], abs=1e-9)
        assert sum(part.mass_kg * part.offset_m for part in rod.parts) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_written_sites_and_rest_pose_agree(name: str) -> None:
    """Read back from the text: rods have their length, sites lie on the caps, both to the micrometre."""
    robot = load(robot_toml(name))
    p_WE = np.array(robot.rest_caps_m)
    cables = [cable.caps for cable in robot.cables]
    np.testing.assert_allclose(
        np.linalg.norm(p_WE[1::2] - p_WE[0::2], axis=1), [rod.length_m for rod in robot.rods], atol=3e-6
    )
    sites = np.array([cable.sites_m for cable in robot.cables])
    arms = site_points(p_WE, cables, sites, rod_frames(p_WE)) - p_WE[np.array(cables)]
    np.testing.assert_allclose(np.linalg.norm(arms, axis=-1), robot.rods[0].cap_radius_m, atol=3e-6)


INDICES = ("schema_version", "cable")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", NAMES)
def test_every_number_has_a_source(name: str, mode: Mode) -> None:
    """A number, or the same key in the first table of its kind, has a comment; only indices stand alone."""
    sourced: set[tuple[str, str]] = set()
    table = kind = ""
    for line in robot_toml(name, mode).splitlines():
        if line.strip().startswith("[["):
            table = kind = line.split("]]")[0]
        part = re.fullmatch(r'\s*(?:name|kind) = "(\w+?)(?:_even|_odd)?".*', line)
        if part and table.strip() in ("[[rods.parts", "[[cables"):
            kind = table + part[1]
        number = re.fullmatch(r"\s*(\w+) = [-\d\[][^#]*(#.*)?", line)
        if number and number[1] not in (*INDICES, "rest_caps_m"):
            # `caps` stand above `kind`: those of all cables are of one kind.
            assert number[2] or (kind, number[1]) in sourced, line
            sourced.add((kind, number[1]))


@pytest.mark.parametrize("name", NAMES)
def test_it_fits_a_screen(name: str) -> None:
    """No line is wider than 115 characters, and no comment behind a number longer than 70."""
    for line in robot_toml(name).splitlines():
        assert len(line) <= 115, line
        assert line.startswith("#") or len(line.partition("  # ")[2]) <= 70, line


@pytest.mark.parametrize("name", NAMES)
def test_sources_are_public(name: str) -> None:
    """Every abbreviation is explained in the head, and no page is named that users do not get."""
    head, _, body = robot_toml(name).partition("\n\n")
    assert set(re.findall(r"\[([A-Z]\d?)\]", body)) <= set(re.findall(r"^# \[([A-Z])\]", head, re.MULTILINE))
    pages = set(re.findall(r"[\w/]+\.md", head + body))
    assert pages == {"docs/concepts/robots.md", "docs/concepts/attachment.md"}
    assert all((DOCS.parent / page).is_file() for page in pages)


def test_cable_numbers_and_sensors_are_the_authors() -> None:
    """Cables and their order are those of the robot's host; sensor i sits on cable i."""
    robot = load(robot_toml("threebar"))
    pairs = [(3, 5), (1, 3), (1, 5), (0, 2), (0, 4), (2, 4), (2, 5), (0, 3), (1, 4)]
    assert [cable.caps for cable in robot.cables] == pairs
    assert [sensor.cable for sensor in robot.sensors] == list(range(9))
    assert robot.actuated == (0, 1, 2, 3, 4, 5)


def test_sensor_pairs_of_the_real_robot(real_dir: Path) -> None:
    """The published list of end caps of each sensor equals the caps of the cable it is said to sit on."""
    text = (real_dir / "tribar_calibration" / "sensor_pairs.csv").read_text(encoding="utf-8")
    pairs = [tuple(int(x) for x in line.split(",")) for line in text.splitlines() if line.strip()]
    robot = load(robot_toml("threebar"))
    assert [robot.cables[sensor.cable].caps for sensor in robot.sensors] == pairs


@pytest.mark.parametrize("name", ["threebar", "threebar-330"])
def test_rest_pose_is_position_one(name: str) -> None:
    """At rest all actuated cables are fully extended: position 1 of the controller; tendons are taut, in the limits."""
    robot = load(robot_toml(name))
    p_WE = np.array(robot.rest_caps_m)
    for cable in robot.cables:
        length = float(np.linalg.norm(p_WE[cable.caps[0]] - p_WE[cable.caps[1]]))
        assert robot.limits.cable_length_min_m < length < robot.limits.cable_length_max_m
        if cable.rest_length_m is None:
            assert (length - robot.pid.min_length_m) / robot.pid.range_m == pytest.approx(1.0, abs=1e-4)
        else:
            assert length > cable.rest_length_m + 0.03
    assert p_WE[:, 2].max() < robot.limits.cap_height_max_m


def test_calibration_can_write_into_it() -> None:
    """tomlkit sets a sensor's line and a part's mass in place; nothing else of the text changes."""
    text = robot_toml("threebar")
    document = tomlkit.parse(text)
    assert tomlkit.dumps(document) == text
    document["sensors"][2]["slope_f_per_m"] = 3.0e-11  # type: ignore[index]
    document["sensors"][2]["offset_f"] = 1.5e-11  # type: ignore[index]
    document["rods"][1]["parts"][4]["mass_kg"] = 0.043  # type: ignore[index]
    changed = tomlkit.dumps(document)
    robot = load(changed)
    assert robot.sensors[2].slope_f_per_m == 3.0e-11
    assert robot.sensors[2].cable == 2
    assert robot.rods[1].parts[4].mass_kg == 0.043
    difference = [line for line in difflib.ndiff(text.splitlines(), changed.splitlines()) if line[0] in "+-"]
    removed = [line[1:].split("#")[0].strip() for line in difference if line[0] == "-" and line[1:].strip()]
    added = [line[1:].split("#")[0].strip() for line in difference if line[0] == "+" and line[1:].strip()]
    assert removed == ["mass_kg = 0.0418"]
    assert added == ["mass_kg = 0.043", "slope_f_per_m = 3e-11", "offset_f = 1.5e-11"]


def test_unknown_robot_names_the_nearest() -> None:
    """A misspelt robot is a usage error whose hint is a command with the nearest name."""
    with pytest.raises(UsageError) as caught:
        robot_toml("threbar330")
    assert caught.value.hint == "--robot threebar-330"


def test_init_texts() -> None:
    """Without a seed only the robot is written, with one the sample and its sidecar too."""
    assert list(init_texts("sixbar")) == ["robot.toml"]
    assert list(init_texts("threebar-330", sample_seed=1)) == ["robot.toml", "sample.csv", "sample.toml"]
    assert init_texts("threebar", "rod_end")["robot.toml"] == robot_toml("threebar", "rod_end")


def test_numbers_are_finite_and_positive_where_they_must_be() -> None:
    """Facts carry no NaN and no empty source."""
    for facts in FACTS.values():
        for value in vars(facts).values():
            if isinstance(value, Fact):
                assert np.isfinite(value.value)
                assert value.source

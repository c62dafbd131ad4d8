"""Rules that the models of hand-written files enforce."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

import pytest
from pydantic import ValidationError

from r2s2r_cli.stages.init.robots import robot_toml
from schemas.base import Frozen
from schemas.config import ProjectFile, RunConfig
from schemas.header import Provenance
from schemas.policy import PolicyFile
from schemas.robot import Robot
from schemas.sidecar import MINIMAL_SIDECAR, PLACEHOLDER, Sidecar
from tests.checks.cases_robots import scaled
from tests.support.builders import provenance

THREEBAR = tomllib.loads(robot_toml("threebar"))
POLICY = {"schema_version": 1, "robot": "threebar", "name": "walk", "steps": [{"target": [0, 1]}, {"target": [1, 0.5]}]}


def changed(values: dict[str, Any], place: str, value: Any) -> dict[str, Any]:
    """A copy with another value at a dotted place; None takes it away."""
    result = copy.deepcopy(values)
    *way, last = place.split(".")
    node: Any = result
    for part in way:
        node = node[int(part)] if isinstance(node, list) else node[part]
    key: Any = int(last) if isinstance(node, list) else last
    if value is None:
        del node[key]
    else:
        node[key] = value
    return result


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("cables.0.caps", [0, 1], "two rods"),
        ("cables.0.caps", [0, 6], "end cap 6 does not exist"),
        ("cables.0.rest_length_m", 0.1, "passive"),
        ("cables.0.kind", "passive", "passive"),
        ("motors.0.cable", 7, "one per actuated cable"),
        ("motors.0", None, "one per actuated cable"),
        ("rest_caps_m.0", None, "one point per end cap"),
        ("limits.cable_length_min_m", 0.5, "must be below"),
        ("rods.0.length_m", -1.0, "greater than 0"),
        ("rods.0.length_m", float("nan"), "finite"),
        ("motors.0.speed", 1.5, "less than or equal to 1"),
        ("schema_version", 2, "1"),
        ("rods.0.colour", "red", "not permitted"),
        ("contact", None, "required"),
    ],
)
def test_robot_descriptions_that_cannot_be(place: str, value: Any, message: str) -> None:
    """Each broken rule is refused, with words that name it."""
    Robot.model_validate(THREEBAR)
    with pytest.raises(ValidationError, match=message):
        Robot.model_validate(changed(THREEBAR, place, value))


def test_targets_have_the_order_of_the_actuated_cables() -> None:
    """`actuated` lists them by index, whatever order the motors stand in."""
    robot = Robot.model_validate(changed(THREEBAR, "motors", THREEBAR["motors"][::-1]))
    assert robot.actuated == (0, 1, 2, 3, 4, 5) and robot.n_caps == 6


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("steps.0.target", [0, 1, 1], "same length"),
        ("steps.0.target", [], "at least 1"),
        ("steps.0.target.0", 1.2, "less than or equal to 1"),
        ("steps.0.hold_s", -1, "greater than or equal to 0"),
        ("steps.0.timeout_s", 0, "greater than 0"),
        ("steps", [], "at least 1"),
        ("repeat", 0, "greater than or equal to 1"),
        ("name", "../walk", "pattern"),
    ],
)
def test_policies_that_cannot_be(place: str, value: Any, message: str) -> None:
    """Each broken rule is refused, with words that name it."""
    assert PolicyFile.model_validate(POLICY).repeat == 1
    with pytest.raises(ValidationError, match=message):
        PolicyFile.model_validate(changed({**POLICY, "repeat": 1}, place, value))


def test_settings_all_have_defaults_and_refuse_what_is_unknown() -> None:
    """An empty config.toml is complete; a misspelt key in any section is an error."""
    empty = RunConfig()
    assert empty == RunConfig.model_validate({"import": {}, "calibrate": {}, "estimate": {}})
    for section in ("import", "calibrate", "estimate"):
        with pytest.raises(ValidationError, match="not permitted"):
            RunConfig.model_validate({section: {"no_such_key": 1}})
    with pytest.raises(ValidationError, match="name"):
        ProjectFile.model_validate({"schema_version": 1})


def test_settings_that_are_not_given_are_valid() -> None:
    """Defaults are made without validation: they are what validation makes of them."""
    made = ProjectFile(schema_version=1, name="p")
    given = made.model_dump(by_alias=True)
    assert ProjectFile.model_validate(given) == made
    for key, field in ProjectFile.model_fields.items():
        if isinstance(field.default, Frozen):
            assert field.default == type(field.default)(), key


def test_the_minimal_sidecar_is_one_once_its_source_is_true() -> None:
    """What `import` shows to a user whose log has none is refused as it is, and taken with another source."""
    with pytest.raises(ValidationError, match="true source"):
        Sidecar.model_validate(tomllib.loads(MINIMAL_SIDECAR))
    filled = MINIMAL_SIDECAR.replace(PLACEHOLDER, "tribar, 2023-02-21, crawl")
    assert Sidecar.model_validate(tomllib.loads(filled)).robot == "threebar"


@pytest.mark.parametrize("factor", [0.15, 3.0, 15.4])
def test_robots_of_other_sizes_are_taken(factor: float) -> None:
    """The bounds catch units, not sizes: the 3-bar robot with rods of 5 cm, 1 m and 5 m is a robot."""
    assert scaled(factor).rods[0].length_m == pytest.approx(0.325 * factor)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("rods.0.length_m", 325, "looks like millimetres"),
        ("motors.0.winch_radius_m", 3.5, "looks like millimetres"),
        ("rods.0.parts.0.mass_kg", 1050, "looks like grams"),
        ("rods.0.parts.0.offset_m", -162.5, "looks like millimetres"),
        ("cables.8.rest_length_m", 165, "looks like millimetres"),
        ("cables.0.sites_m.0.2", 162.5, "looks like millimetres"),
        ("cables.0.stiffness_n_per_m", 2e11, "modulus of the material in pascals"),
        ("sensors.0.stiffness_n_per_m", 1e11, "modulus of the material in pascals"),
        ("pid.rate_hz", 0.02, "looks like the period in seconds"),
        ("pid.step_timeout_s", 0.001, r"within step_timeout_s \(0\.001 s\), else every step is given up"),
        ("pid.tolerance", 12, "looks like per cent"),
        ("pid.step_timeout_s", 6000, "looks like milliseconds"),
        ("limits.cable_length_max_m", 350.0, "looks like millimetres"),
        ("sensors.0.slope_f_per_m", 0.0272, "looks like pF/mm"),
        ("sensors.0.offset_f", 12.5, "looks like pF"),
        ("cables.8.stiffness2_n_per_m2", 2e13, "looks like the modulus"),
        ("cables.8.stiffness3_n_per_m3", -2e16, "looks like the modulus"),
        ("cables.8.damping_n_s_per_m", 1e7, "is more than any cable has"),
        ("motors.0.no_load_rad_per_s", 3e4, "looks like revolutions per minute"),
        ("pid.p", 65535, "looks like counts of a motor board"),
        ("pid.rate_hz", 1e6, "is faster than any controller"),
        ("contact.friction", 60, "looks like per cent"),
        ("name", "", "a name with at least one letter"),
        ("rods.0.name", "  ", "a name with at least one letter"),
        ("rods.0.cap_radius_m", 0.1625, "overlap"),
        ("colors.0.hue", [0, 360], "less than or equal to 180"),
        ("colors.0.hue", [-5, 10], "greater than or equal to 0"),
        ("colors.0.value_min", 256, "less than or equal to 255"),
        ("colors.0.rod", "yellow", "there is no rod yellow, the rods are red, green, blue"),
        ("colors.1.rod", "red", "two colours"),
        ("rods.1.name", "red", "two rods have the name red"),
        ("sensors.1.cable", 0, "two sensors"),
        ("rods.0.length_m", "0.325", "valid number"),
        ("rods.0.length_m", True, "valid number"),
        ("cables.0.caps.0", "3", "valid integer"),
        ("rest_caps_m.0.0", "0.1", "valid number"),
        ("pid.p", "6", "valid number"),
        ("illustrative", "no", "valid boolean"),
    ],
)
def test_slips_of_unit_name_and_type_are_refused(place: str, value: Any, message: str) -> None:
    """A number in another unit is refused with the unit it looks like; text is no number; names must fit together."""
    with pytest.raises(ValidationError, match=message):
        Robot.model_validate(changed(THREEBAR, place, value))


def test_policies_in_milliseconds_or_text_are_refused() -> None:
    """Times of a step above an hour, endless repeats and numbers in quotes."""
    for place, value in (("hold_s", 6000), ("timeout_s", 6000), ("target", ["0", "1"])):
        with pytest.raises(ValidationError, match=r"looks like milliseconds|valid number"):
            PolicyFile.model_validate(changed(POLICY, f"steps.0.{place}", value))
    with pytest.raises(ValidationError, match="less than or equal"):
        PolicyFile.model_validate({**POLICY, "repeat": 10**9})


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("estimate", "contact_clearance_m", 4),
        ("estimate", "contact_lift_m_per_s", 30),
        ("estimate", "sensor_gap_s", 250),
        ("estimate", "switch_kick_m_per_s", 20),
        ("calibrate", "swap_threshold_m", 50),
        ("import", "rod_length_tolerance", 5),
        ("estimate", "contact_clearance_m", "0.003"),
    ],
)
def test_absurd_settings_are_refused(section: str, key: str, value: Any) -> None:
    """Settings have an upper bound where a larger value is another unit, and are numbers."""
    with pytest.raises(ValidationError, match=r"less than|valid number"):
        RunConfig.model_validate({section: {key: value}})


def test_provenance_refuses_what_is_no_digest() -> None:
    """A configuration hash of the wrong length cannot be recorded, nor a negative duration."""
    assert isinstance(provenance(), Provenance)
    for wrong in ({"config_sha256": "abc"}, {"wall_s": -1.0}):
        with pytest.raises(ValidationError):
            provenance(**wrong)

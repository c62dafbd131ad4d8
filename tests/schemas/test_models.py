"""Rules that the models of hand-written files enforce."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

import pytest
from pydantic import ValidationError

from r2s2r_cli.stages.init.robots import robot_toml
from schemas.config import ProjectFile, RunConfig
from schemas.header import Provenance
from schemas.policy import PolicyFile
from schemas.robot import Robot
from schemas.sidecar import MINIMAL_SIDECAR, Sidecar
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


def test_the_minimal_sidecar_is_one() -> None:
    """What `import` shows to a user whose log has none can be used as it is."""
    assert Sidecar.model_validate(tomllib.loads(MINIMAL_SIDECAR)).robot == "threebar"


def test_provenance_refuses_what_is_no_digest() -> None:
    """A configuration hash of the wrong length cannot be recorded, nor a negative duration."""
    assert isinstance(provenance(), Provenance)
    for wrong in ({"config_sha256": "abc"}, {"wall_s": -1.0}):
        with pytest.raises(ValidationError):
            provenance(**wrong)

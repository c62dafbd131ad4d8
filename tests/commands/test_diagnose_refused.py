"""What cannot be diagnosed: the exit code, the reason, one line that helps, and nothing written."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.diagnose_inputs import Asked
from r2s2r_cli.commands.named_runs import require_robot
from r2s2r_cli.errors import InputError
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.write import write_artifact
from tests.commands.conftest import invoke
from tests.support.builders import provenance
from tests.support.identified import identification


def artifacts(root: Path) -> set[str]:
    """What a diagnosis would leave."""
    return {path.name for path in root.glob("iterations/*/70-*")}


def test_without_an_identification_it_says_which_command_is_missing(estimated: Path) -> None:
    """Exit code 4: the artifact of the stage before."""
    result = invoke("diagnose", "--json")
    assert result.exit_code == 4
    error = json.loads(result.stdout)
    assert error["expected"] == "30-identify.h5" and error["hint"].startswith("r2s2r identify")
    assert not artifacts(estimated)


def test_an_effect_that_does_not_exist_is_a_usage_error(estimated: Path) -> None:
    """Exit code 2, with the nearest name."""
    result = invoke("diagnose", "--effect", "paylod", "--json")
    assert result.exit_code == 2
    assert "payload" in json.loads(result.stdout)["hint"]
    assert not artifacts(estimated)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("motor_dead_zone:3", "r2s2r diagnose --seed 4 --effect motor_dead_zone --json"),
        ("motor_deadzone:3", "r2s2r diagnose --seed 4 --effect motor_dead_zone --json"),
        ("slope", "r2s2r diagnose --seed 4 --effect ground_slope --json"),
        ("none", "r2s2r effects"),
    ],
)
def test_an_effect_is_named_alone(estimated: Path, name: str, hint: str) -> None:
    """Its element is found, not chosen; what is near no effect is answered with the list."""
    error = json.loads(invoke("diagnose", "--effect", name, "--seed", "4", "--json").stdout)
    assert (error["exit_code"], error["where"], error["received"]) == (2, "--effect", name)
    assert error["hint"] == hint
    assert ("diagnose finds" in error["what"]) == (name == "motor_dead_zone:3")


def test_a_model_that_is_not_there_is_named_so(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file of --model is missing, not the stage before; the hint has one that is there, the rest as typed."""
    asked(estimated)
    words = ["diagnose", "--model", "nosuch.h5", "--seed", "4"]
    monkeypatch.setattr("sys.argv", ["r2s2r", *words])
    refused = invoke(*words)
    assert refused.exit_code == 4 and "there is no such identification\n  where: --model" in refused.stderr
    assert refused.stderr.splitlines()[-1] == "hint: r2s2r diagnose --model iterations/001/30-identify.h5 --seed 4"


def test_the_settings_are_shown_without_anything_to_diagnose(estimated: Path) -> None:
    """They are what the command would use."""
    result = invoke("diagnose", "--show-config")
    assert result.exit_code == 0 and "members = 16" in result.stdout
    assert not artifacts(estimated)


def asked(root: Path) -> Asked:
    """Of the estimated project with an identification that names its own run."""
    here = Project.find(root)
    write_artifact(root / "iterations/001/30-identify.h5", identification(here.robot()), provenance())
    return Asked(here, here.iteration(1), train=("sample:1-3",), test=("sample:4",))


def test_a_model_without_uncertainty_is_said(estimated: Path) -> None:
    """The numbers whose sd the identification does not have are named among what is missing; one run is marked."""
    evidence = asked(estimated).evidence()
    assert evidence.missing == (
        "uncertainty of restitution: 30-identify.h5 has none, so the refit takes its usual priors",
    )
    assert evidence.within_run and evidence.floor is None


@pytest.mark.parametrize(
    ("typed", "where", "hint"),
    [
        ("--train sample:1 --test sample:2", "--train", "r2s2r diagnose --train sample:1-"),
        (
            "--train sample:1-3 --test sample:2-4",
            "--train, --test",
            "r2s2r diagnose --train sample:1 --test sample:2-4",
        ),
        ("--healthy smaple --seed 4", "--healthy", "r2s2r diagnose --seed 4 --healthy sample --json --dry-run"),
        ("--also 5", "--also", "r2s2r status"),
        ("--also 1 --seed 3", "--also", "r2s2r diagnose --seed 3 --json --dry-run"),
    ],
)
def test_a_wrong_request_has_a_command_as_its_hint(estimated: Path, typed: str, where: str, hint: str) -> None:
    """Whole, with what was asked for; the option that is wrong is named."""
    asked(estimated)
    refused = invoke("diagnose", *typed.split(), "--dry-run", "--json")
    error = json.loads(refused.stdout)
    assert refused.exit_code in (2, 4) and error["where"] == where
    assert error["hint"].startswith(hint)
    assert not artifacts(estimated)


def test_another_robot_is_refused(estimated: Path) -> None:
    """Numbers or a run of one are not taken for those of this one: it says whose they are."""
    one = asked(estimated)
    robot = estimated / "robot.toml"
    robot.write_text(robot.read_text().replace('name = "threebar"', 'name = "sixbar"', 1))
    one = dataclasses.replace(one, project=Project.find(estimated))
    with pytest.raises(InputError, match="identified for another robot"):
        one.evidence()
    recording = ArtifactData("recording", {"runs/walk": Group({}, {"robot": "sixbar"})})
    with pytest.raises(InputError, match="run walk is of another robot") as caught:
        require_robot(recording, "walk", "threebar")
    assert caught.value.received == "sixbar" and caught.value.hint.startswith("r2s2r status")
    require_robot(recording, "walk", "sixbar")

"""`floor` in a project: the sample with estimated caps, nothing that repeats, and the numerics of engine and rig."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from r2s2r_cli.commands.floor_numerics import numerics
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke


def test_what_a_single_run_gives_is_said(estimated: Path) -> None:
    """The kinematic sample comes to one phase twice, on other caps: a floor of lengths, none of caps, and why."""
    result = document("floor", "--no-draw")
    report = result["report"]
    assert report["caps"] is None and report["lengths"]["basis"] == "same phase within a run"
    assert 0 < report["lengths"]["floor_m"] < 0.01
    assert any("no phase of a gait comes twice" in text for text in report["warnings"])
    assert any("slow drift" in text for text in report["warnings"])
    _, data = read_artifact(estimated / "floor.h5", "floor")
    assert list(data.groups) == ["lengths"]
    assert data.groups["lengths"].attributes["floor"] == report["lengths"]["floor_m"]
    (state,) = [one for one in document("status")["artifacts"] if one["stage"] == "floor"]
    assert state["state"] == "fresh"


def test_nothing_to_measure_with_is_said(project: Path) -> None:
    """No iteration yet: exit code 4, as of every command without its input, and what brings data; no floor.h5."""
    result = invoke("floor", "--json")
    assert result.exit_code == 4 and json.loads(result.stdout)["hint"] == "r2s2r import sample.csv"
    assert not (project / "floor.h5").exists()


@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
def test_numerics_without_mujoco_say_what_to_install(
    estimated: Path, dry: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is computed, and in a dry run too."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    result = invoke("floor", "--numerics", "3", *dry)
    assert result.exit_code == 4 and "MuJoCo is not installed" in result.stderr and "[rig]'" in result.stderr
    assert not (estimated / "floor.h5").exists()


@pytest.mark.slow
def test_engine_and_rig_agree_to_what_the_engine_issue_measured(project: Path) -> None:
    """16 gait steps at the robot's friction of 0.76: median within 1 to 3 mm, worst below 12 mm, while caps move
    tens of mm (docs/concepts/mujoco.md has 1.8 and 7.2 mm)."""
    found = numerics(Project.find(project).robot(), 16)
    assert 0.001 < float(sorted(found.error)[8]) < 0.003 and found.error.max() < 0.012
    assert sorted(found.way)[8] > 0.02


def test_executed_runs_are_looked_at_too(estimated: Path) -> None:
    """Most repeats are there. A name that a recorded run has is told apart; without executed runs they are the same."""
    place = estimated / "iterations" / "001"
    alone = document("floor", "--no-draw")
    for source, target in (("10-record.h5", "50-execute.h5"), ("20-estimate.h5", "51-estimate.h5")):
        (place / target).write_bytes((place / source).read_bytes())
    both = document("floor", "--no-draw")
    assert alone["report"]["runs"] == ["1:sample"]
    assert both["report"]["runs"] == ["1:sample", "1:executed-sample"]
    assert {Path(name).name for name in both["inputs"]} == {
        "10-record.h5", "20-estimate.h5", "50-execute.h5", "51-estimate.h5",
    }  # fmt: skip
    assert both["report"]["lengths"]["contrasts"] > alone["report"]["lengths"]["contrasts"]


def test_an_iteration_that_is_asked_for_twice_counts_once(estimated: Path) -> None:
    """A run beside itself would repeat itself perfectly."""
    once = document("floor", "--no-draw", "--iteration", "1")
    twice = document("floor", "--no-draw", "--iteration", "1", "--iteration", "1")
    assert twice["state"] == "fresh" and twice["report"] == once["report"] and twice["report"]["runs"] == ["1:sample"]

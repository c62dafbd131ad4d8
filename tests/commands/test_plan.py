"""`plan` in a project: what it writes, that it goes on, and what it refuses."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.write import write_artifact
from tests.commands.conftest import document, invoke
from tests.support import builders

PLAN = "iterations/001/40-plan.h5"
IDENTIFY = "iterations/001/30-identify.h5"
SMALL = {"depth": 2, "draws": 2, "starts": 1, "candidates": 3, "kept": 2, "cycles": 2, "most_changed": 2}
"""A plan of seconds: one shape between rest and rest."""


def small(*more: str, **changes: Any) -> list[str]:
    """The command line of a small plan."""
    sets = [word for key, value in {**SMALL, **changes}.items() for word in ("--set", f"plan.{key}={value}")]
    return ["plan", *more, *sets]


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with a small plan, drawn."""
    root = tmp_path_factory.mktemp("planned") / "robot"
    assert invoke("init", str(root)).exit_code == 0
    result = invoke(*small("--to", "0.1,0,0", goal_within_m=1.0), "--project", str(root))
    assert result.exit_code == 0, result.stderr
    return root


@pytest.fixture
def planned(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that project, as the working directory."""
    root = tmp_path / "robot"
    shutil.copytree(template, root)
    monkeypatch.chdir(root)
    return root


@pytest.mark.slow
def test_a_plan_is_whole(planned: Path) -> None:
    """The artifact validates; every gait and long policy is a policy in it, ends at rest, and the best ones were run;
    pictures lie beside it, and the page holds them and a player."""
    assert invoke("validate", PLAN).exit_code == 0
    _, data = read_artifact(planned / PLAN, "plan")
    names = [name.decode() for name in data.groups["primitives"]["name"]]
    long = [name.decode() for name in data.groups["long"]["name"]]
    assert long == ["straight", "arching", "turn-clockwise", "turn-counterclockwise"]
    assert len(names) == 8 and {f"policies/{name}" for name in names + long} <= set(data.groups)
    assert set(data.runs()) == {"forward-1", "backward-1", "clockwise-1", "counterclockwise-1", *long}
    for name in names + long:
        assert (data.groups[f"policies/{name}"]["target"][-1] == 1).all()
    table = data.groups["primitives"]
    assert np.allclose(table["score"], table["mean"] - table["sd"])
    page = (planned / "iterations/001/40-plan.html").read_text()
    assert page.count("data:image/png") == 3 and "startPlayback" in page and "http" not in page.replace("http-", "")
    for name in ("gaits", "policies", "scores"):
        assert (planned / f"iterations/001/40-plan-{name}.png").stat().st_size > 10_000


@pytest.mark.slow
def test_it_is_fresh_and_its_policies_run(planned: Path) -> None:
    """The same command has nothing to do, and made again it gives the same bits; `simulate 40-plan.h5:NAME` runs a
    policy, and comes as far as in the plan."""
    again = document(*small("--to", "0.1,0,0", goal_within_m=1.0))
    assert any(text.startswith("to: the robot stands there already") for text in again["report"]["warnings"])
    assert again["state"] == "fresh"
    forced = document(*small("--to", "0.1,0,0", goal_within_m=1.0), "--force", "--no-draw")
    assert forced["state"] == "done" and forced["content_sha256"] == again["content_sha256"]
    result = document("simulate", f"{PLAN}:straight", "--no-draw")
    _, data = read_artifact(planned / PLAN, "plan")
    p_WE = data.groups["runs/straight/frames"]["p_WE"]
    moved = (p_WE[-1] - p_WE[0]).mean(axis=0)
    assert np.allclose(result["report"]["runs"][0]["com_displacement_m"], moved, atol=2e-3)


@pytest.mark.slow
def test_an_interrupted_plan_goes_on_to_the_same(planned: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after the search and begun again with --resume: nothing is searched again, and the content hash is that
    of the plan that was never stopped."""
    import r2s2r_cli.stages.plan.stage as stage

    command = small("--to", "0.1,0,0", goal_within_m=1.0)
    before = read_header(planned / PLAN).content_sha256
    Path(PLAN).unlink()
    with monkeypatch.context() as patch:
        patch.setattr(stage, "chosen", _interrupt)
        stopped = invoke(*command)
    assert stopped.exit_code == 130 and "--resume" in stopped.stderr and not Path(PLAN).exists()
    monkeypatch.setattr(stage, "Search", None)
    resumed = invoke(*command, "--resume")
    assert resumed.exit_code == 0, resumed.stderr
    assert read_header(planned / PLAN).content_sha256 == before
    assert not list(planned.rglob("*.partial"))


def _interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.slow
def test_what_was_identified_is_used(planned: Path) -> None:
    """With 30-identify.h5 the plan is made with its numbers, and says so; its policies are refused by another robot."""
    write_artifact(planned / IDENTIFY, builders.identification(), builders.provenance())
    result = document(*small(), "--no-draw")
    assert result["report"]["identified"] and result["inputs"] == [IDENTIFY]
    assert "30-identify.h5" in result["report"]["numbers"]
    text = (planned / "robot.toml").read_text()
    (planned / "robot.toml").write_text(text.replace('name = "threebar"', 'name = "mine"', 1))
    # A policy of the plan is one of the robot as it was called.
    other = invoke("simulate", f"{PLAN}:straight", "--no-draw")
    assert other.exit_code == 4 and "another robot" in other.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--behaviour", "upwards"], "no such behaviour"),
        (["--behaviour", "nowhere.at:all"], "cannot be loaded"),
        (["--to", "1,2"], "no place to go to"),
        (["--to", "1,2,nan"], "no place to go to"),
        (["--set", "plan.depth=1"], "plan.depth"),
    ],
)
def test_what_cannot_be_planned_is_said_at_once(project: Path, arguments: list[str], said: str) -> None:
    """Usage and settings are looked at before any work, and nothing is written."""
    result = invoke("plan", *arguments)
    assert result.exit_code in (2, 4) and said in result.stderr
    assert not list(project.rglob("40-plan*"))


@pytest.mark.parametrize("known", [False, True])
def test_that_nothing_was_identified_is_said_before_the_work(
    project: Path, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """Whoever forgot `identify` is told while the search can still be stopped; with one nothing is said."""
    import r2s2r_cli.stages.plan.stage as stage

    monkeypatch.setattr(stage, "plan", _interrupt)
    if known:
        write_artifact(project / IDENTIFY, builders.identification(), builders.provenance())
    stopped = invoke(*small())
    assert stopped.exit_code == 130, stopped.stderr
    assert ("nothing was identified in iteration 1" in stopped.stderr) != known
    assert ("r2s2r identify --iteration 1" in stopped.stderr) != known


def test_numbers_of_another_robot_are_refused(project: Path) -> None:
    """An identification of another robot, or of robot.toml before a change: exit code 4 with the reason, at once."""
    target = project / IDENTIFY
    target.parent.mkdir(parents=True)
    stale = builders.provenance(stage="identify", robot={"contact": {"friction": 0.1}})
    write_artifact(target, builders.identification(), stale)
    refused = invoke("plan")
    assert refused.exit_code == 4 and "another version of robot.toml" in refused.stderr
    text = (project / "robot.toml").read_text()
    (project / "robot.toml").write_text(text.replace('name = "threebar"', 'name = "mine"', 1))
    refused = invoke("plan", "--dry-run")
    assert refused.exit_code == 4 and "another name" in refused.stderr


def test_numbers_of_another_version_of_identify_are_refused(project: Path) -> None:
    """What it computed then may mean something else: exit code 4, with the command that makes them anew."""
    target = project / IDENTIFY
    target.parent.mkdir(parents=True)
    write_artifact(target, builders.identification(), builders.provenance(stage="identify", stage_version=99))
    refused = invoke("plan", "--dry-run")
    assert refused.exit_code == 4 and "another version of identify" in refused.stderr
    assert "received: version 99" in refused.stderr and "hint: r2s2r identify --iteration 1" in refused.stderr


@pytest.mark.slow
def test_no_way_to_a_goal_is_said(planned: Path) -> None:
    """A place that the gaits cannot reach in the time that is searched: exit code 6, with the nearest place."""
    result = invoke(*small("--to", "40,40,90", goal_within_m=0.001), "--no-draw")
    assert result.exit_code == 6 and "nearest" in result.stderr

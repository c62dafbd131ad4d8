"""What `execute` takes of a plan by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.execute import _ask, _long, _require_fresh
from r2s2r_cli.commands.record_journal import Recording
from r2s2r_cli.commands.typed import typed_again
from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.plan.view import far
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project, journal_of
from r2s2r_cli.store.write import write_artifact
from schemas.header import InputRef
from tests.commands.conftest import invoke
from tests.support import builders

GAIT = """\
schema_version = 1
robot = "{robot}"
name = "gait"
[[steps]]
target = {target}
"""


def test_the_long_policies_are_the_default(tmp_path: Path) -> None:
    """Not all 44; of a plan without any the best gait of every behaviour."""
    data = builders.plan()
    path = tmp_path / "40-plan.h5"
    write_artifact(path, data, builders.provenance(stage="plan"))
    assert _long(path) == ["straight"]
    write_artifact(path, ArtifactData("plan", {k: v for k, v in data.groups.items() if k != "long"}),
                   builders.provenance(stage="plan"))  # fmt: skip
    assert _long(path) == ["forward-1"]


def test_how_far_a_run_goes_is_its_farthest_place() -> None:
    """There and back counts the way out, whatever the end."""
    p = np.zeros((3, 2, 3))
    p[1, :, 0] = [0.5, 0.7]
    assert far(ArtifactData("simulation", {"runs/a/frames": Group({"p_WE": p}), "runs/b": Group()})) == {"a": 0.6}


@pytest.mark.parametrize("policy", ["straight", "iterations/001/40-plan.h5:straight"])
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"stage_version": 99}, "made by version 99"),
        ({"inputs": (InputRef(path="iterations/001/30-identify.h5", kind="identification", sha256="1" * 64),)},
         "iterations/001/30-identify.h5"),
        ({"robot": {"name": "threebar", "contact": {"friction": 0.1}}}, "robot.toml: contact"),
    ],
)  # fmt: skip
def test_a_plan_of_another_simulator_is_refused(project: Path, policy: str, changed: dict[str, Any], said: str) -> None:
    """Of another version, of other identified numbers, of another robot.toml; named by itself or with its file: exit
    code 4 with the reason, and nothing moves."""
    place = project / "iterations" / "001"
    place.mkdir(parents=True)
    made = builders.provenance(**{"stage": "plan", "inputs": (), **changed})
    write_artifact(place / "40-plan.h5", builders.plan(), made)
    refused = invoke("execute", policy, "--dry-run")
    assert refused.exit_code == 4
    assert "the plan is stale" in refused.stderr and said in refused.stderr
    assert "hint: r2s2r plan --iteration 1" in refused.stderr
    assert not list(place.glob("50-*"))


@pytest.mark.parametrize(("robot", "target"), [("sixbar", [0.5] * 6), ("threebar", [0.5] * 24)])
def test_a_policy_of_another_robot_is_refused(project: Path, robot: str, target: list[float]) -> None:
    """By its name, or by how many motors it moves: exit code 4, and nothing moves."""
    (project / "iterations" / "001").mkdir(parents=True)
    (project / "gait.toml").write_text(GAIT.format(robot=robot, target=target))
    refused = invoke("execute", "gait.toml", "--iteration", "1", "--dry-run")
    assert refused.exit_code == 4 and "policy gait is for another robot" in refused.stderr
    assert not list(project.rglob("50-*"))


def test_a_robot_that_nobody_named_is_asked_for_before_anything_is_simulated(project: Path) -> None:
    """A simulation takes its time; without a port nothing can follow it."""
    (project / "iterations" / "001").mkdir(parents=True)
    (project / "gait.toml").write_text(GAIT.format(robot="threebar", target=[0.5] * 6))
    refused = invoke("execute", "gait.toml", "--yes")
    assert refused.exit_code == 2 and "no robot is named" in refused.stderr
    assert "what the simulator expects" not in refused.stderr


def test_a_plan_of_a_stale_identification_is_executed_with_a_warning(
    estimated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its policies are still policies of this robot; that the numbers behind them are old is said."""
    place = estimated / "iterations" / "001"
    made = place / "30-identify.h5"
    write_artifact(made, builders.identification(), builders.provenance(stage="identify", stage_version=1, inputs=()))
    monkeypatch.setattr("r2s2r_cli.store.staleness.reasons", lambda *_: [])  # of the plan itself
    ref = InputRef(path="iterations/001/30-identify.h5", kind="identification", sha256=read_header(made).content_sha256)
    write_artifact(place / "40-plan.h5", builders.plan(), builders.provenance(stage="plan", inputs=(ref,)))
    console = Console()
    said: list[str] = []
    monkeypatch.setattr(console, "warn", said.append)
    _require_fresh(Project.find(estimated), Project.find(estimated).iteration(1), place / "40-plan.h5", console)
    new, old = said  # of states that came later no policy is of another robot either
    assert new.startswith("iterations/001/40-plan.h5: input iterations/001/20-estimate.h5 is new")
    stale = "iterations/001/40-plan.h5: its input iterations/001/30-identify.h5 is stale itself: stage identify changed"
    assert old.startswith(stale)


@pytest.mark.parametrize("command", ["execute", "compare", "simulate"])
def test_an_identification_that_is_not_there_is_named(
    estimated: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As what was typed, and with one that is there in its place."""
    place = estimated / "iterations" / "001"
    (estimated / "gait.toml").write_text(GAIT.format(robot="threebar", target=[0.5] * 6))
    write_artifact(place / "30-identify.h5", builders.identification(), builders.provenance(stage="identify"))
    words = [command, *(["gait.toml"] if command != "compare" else ["--of", "record"]), "--model", "no.h5"]
    words += ["--dry-run"] if command != "simulate" else []
    monkeypatch.setattr("sys.argv", ["r2s2r", *words])
    refused = invoke(*words)
    assert refused.exit_code == 4, refused.stderr
    assert "there is no such identification\n  where: --model" in refused.stderr
    hint = ["iterations/001/30-identify.h5" if word == "no.h5" else word for word in words]
    assert refused.stderr.rstrip().endswith("hint: r2s2r " + " ".join(hint))


def test_a_misspelt_policy_is_answered_with_the_next_one(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line as typed, with the name that is there."""
    plan = estimated / "iterations" / "001" / "40-plan.h5"
    write_artifact(plan, builders.plan(), builders.provenance(stage="plan"))
    text = "iterations/001/40-plan.h5:straigth"
    monkeypatch.setattr("sys.argv", ["r2s2r", "simulate", text])
    refused = invoke("simulate", text)
    assert refused.exit_code == 2 and "there is no such policy" in refused.stderr
    assert refused.stderr.endswith("hint: r2s2r simulate iterations/001/40-plan.h5:straight\n")


def test_nobody_to_ask_is_told_the_command_as_typed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Policy, port and --force stay in the hint, --yes is added; where the answer is no, --dry-run."""
    place = project / "iterations" / "001"
    place.mkdir(parents=True)
    (project / "gait.toml").write_text(GAIT.format(robot="threebar", target=[0.5] * 6))
    words = ["execute", "gait.toml", "--port", "socket://h:1", "--force"]
    monkeypatch.setattr("sys.argv", ["r2s2r", *words])
    refused = invoke(*words)
    assert refused.exit_code == 2
    assert refused.stderr.endswith("hint: r2s2r execute gait.toml --port socket://h:1 --force --yes\n")
    assert typed_again("execute", "--dry-run") == "r2s2r execute gait.toml --port socket://h:1 --force --dry-run"
    assert typed_again("record", "--yes") == "r2s2r record --yes"


def test_runs_in_the_way_and_nobody_to_ask_are_one_hint(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither option alone would do."""
    place = project / "iterations" / "001"
    place.mkdir(parents=True)
    (place / "50-execute.h5").write_bytes(b"runs")
    (project / "gait.toml").write_text(GAIT.format(robot="threebar", target=[0.5] * 6))
    words = ["execute", "gait.toml", "--port", "socket://h:1"]
    monkeypatch.setattr("sys.argv", ["r2s2r", *words])
    refused = invoke(*words)
    assert refused.exit_code == 2
    assert f"hint: r2s2r {' '.join(words)} --yes --force   #" in refused.stderr


def test_a_dry_run_leads_to_the_command_that_runs_them_again(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where runs are in the way: not to another dry run."""
    place = project / "iterations" / "001"
    place.mkdir(parents=True)
    (place / "50-execute.h5").write_bytes(b"runs")
    monkeypatch.setattr("sys.argv", ["r2s2r", "execute", "gait.toml", "--dry-run", "--port", "p"])
    here = Project.find(project)
    refusal = Recording(here, here.iteration(1), {}, {}, None, "execute").refusal(force=False)
    assert refusal is not None
    assert refusal.hint == "r2s2r execute gait.toml --port p --force   # the old runs stay as .replaced"


@pytest.mark.parametrize("answer", [True, False])
def test_a_robot_moves_only_after_a_yes(answer: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked on stderr; no is exit code 2, with what shows the outcome again."""
    asked: list[tuple[str, bool]] = []

    def confirm(text: str, *, err: bool) -> bool:
        asked.append((text, err))
        return answer

    monkeypatch.setattr("typer.confirm", confirm)
    monkeypatch.setattr("sys.argv", ["r2s2r", "execute", "straight"])
    if answer:
        _ask(Console(quiet=True))
    else:
        with pytest.raises(UsageError, match="nothing moved") as caught:
            _ask(Console(quiet=True))
        assert caught.value.hint == "r2s2r execute straight --dry-run"
    assert asked == [("run these policies on the robot?", True)]


@pytest.mark.parametrize("cut_off", [False, True])
def test_a_dry_run_shows_the_outcome_whatever_is_there(project: Path, cut_off: bool) -> None:
    """Runs that were executed, or the journal of some: exit code 0, the outcome, what stands in the way of the robot
    and not a byte changed. Without --dry-run it is refused."""
    place = project / "iterations" / "001"
    place.mkdir(parents=True)
    (project / "gait.toml").write_text(GAIT.format(robot="threebar", target=[0.5] * 6))
    there = journal_of(place / "50-execute.h5") if cut_off else place / "50-execute.h5"
    there.write_bytes(b"runs")
    asked = ("execute", "gait.toml", "--iteration", "1")
    shown = invoke(*asked, "--dry-run")
    assert shown.exit_code == 0, shown.stderr
    assert "what the simulator expects" in shown.stderr and "gait" in shown.stdout
    assert "without --dry-run this would be refused" in shown.stderr
    assert ("r2s2r recover" if cut_off else "--force") in shown.stderr
    assert [path.read_bytes() for path in place.iterdir()] == [b"runs"]
    refused = invoke(*asked, "--port", "socket://h:1", "--yes")
    assert refused.exit_code == 2 and "what the simulator expects" not in refused.stderr

"""The command that makes an artifact again asks for what was asked: nothing of it is forgotten on the way."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import pytest

from r2s2r_cli.commands import COMMANDS
from r2s2r_cli.errors import GateError
from r2s2r_cli.options import parse_overrides
from r2s2r_cli.store.again import OPTIONS, command_again
from r2s2r_cli.store.project import Project
from schemas.versions import STAGE_VERSIONS
from tests.commands.conftest import invoke
from tests.guards.listing import ROOT, commands
from tests.support import builders

SAMPLE = ROOT / "examples" / "sample-project" / "project"
HOW = {"project", "iteration", "json", "quiet", "draw", "dry_run", "force", "resume", "show_config", "yes"}
"""Options that say where and how, not what. `iteration` of `floor` says what, and is asked for below."""
WITHOUT_ARTIFACT = {"self_test"}
"""`identify --self-test` leaves none."""
BY_SETTING = {"set_", "starts"}
"""Options that are kept with the settings: `--starts N` is `--set identify.starts=N`."""
MODEL = "iterations/001/30-identify.h5"
ROBOT = ("--port", "socket://h:1", "--protocol", "legacy", "--camera", "open3d", "--repeats", "3", "--simulated")
ASKED: dict[str, tuple[str, ...]] = {
    "import": ("a b.csv", "c.csv", "--format", "trajectory_csv", "--depth-scale", "0.00025",
               "--set", "import.rod_length_tolerance=0.1"),
    "calibrate": ("--points", "points.csv", "--history", "old.json", "--tendons", "one.csv", "--tendons", "two.csv",
                  "--masses", "masses.toml", "--use", "monday", "--set", "calibrate.max_error_m=0.004"),
    "record": ("policies/walk.toml", "--random", "4", "--levels", "3", "--seed", "7", "--excite", "ramps", "--excite",
               "holds", *ROBOT, "--set", "record.rest_s=2.5"),
    "estimate": ("--of", "execute", "--set", "estimate.contact_clearance_m=1e-5"),
    "identify": ("--train", "walk:1-2", "--test", "walk:3", "--free", "friction=0.5,0.2..1.5,~0.3", "--fix",
                 "restitution=0.1", "--with-effect", "motor_lag:1", "--method", "cma", "--drive", "closed-loop",
                 "--no-discrepancy", "--online", "--also", "1", "--starts", "2", "--seed", "5",
                 "--set", "identify.train_share=0.5"),
    "plan": ("--behaviour", "forward", "--behaviour", "clockwise", "--to", "-0.5,1,90", "--seed", "3",
             "--set", "plan.reach_m=2"),
    "execute": ("straight", "policies/walk.toml", "--model", MODEL, *ROBOT, "--yes", "--set", "record.rest_s=2"),
    "simulate": ("policies/walk.toml", "iterations/001/40-plan.h5:straight", "--random", "4", "--seed", "9",
                 "--replay", "walk", "--from", "rest", "--model", MODEL, "--iteration", "1",
                 "--set", "simulate.frame_s=0.05"),
    "compare": ("--model", f"the first={MODEL}", "--model", "iterations/002/30-identify.h5", "--of", "execute",
                "--own"),
    "floor": ("--iteration", "1", "--iteration", "2", "--by", "displacement", "--numerics", "4"),
    "diagnose": ("--train", "walk:1-2", "--test", "walk:3", "--healthy", "walk", "--effect", "motor_lag", "--effect",
                 "payload", "--model", "iterations/002/30-identify.h5", "--also", "1", "--seed", "5",
                 "--set", "diagnose.members=24"),
}  # fmt: skip
"""Of every stage a command with all its options, on the sample project."""


@dataclass(frozen=True)
class Request:
    """What a command line asks for, as far as provenance tells."""

    stage: str
    flags: Mapping[str, Any]
    overrides: Mapping[str, Any]
    inputs: tuple[Any, ...]
    seed: int | None
    target: Path


HEARD: list[Request] = []
"""What the command lines of a test asked for."""


def _understood(request: Request) -> NoReturn:
    """Instead of computing."""
    HEARD.append(request)
    raise GateError("this test computes nothing", where="", expected="", received="", hint="")


@pytest.fixture
def sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the sample project as the working directory, with files to import and to calibrate from. Stages stop
    where they have understood what they were asked for."""
    root = Path(shutil.copytree(SAMPLE, tmp_path / "project"))
    monkeypatch.chdir(root)
    for name in ("a b.csv", "c.csv", "old.json", "one.csv", "two.csv", "masses.toml"):
        (root / name).write_text("t_s\n")

    def computed(stage: str, kind: str, project: Project, find_inputs: Any, iteration: Any = None,
                 flags: Any = None, overrides: Any = None, executed: bool = False, **how: Any) -> None:  # fmt: skip
        target = project.artifact(kind, iteration, executed=executed)
        _understood(Request(stage, flags or {}, overrides or {}, tuple(find_inputs()), None, target))

    def recorded(wish: Any, console: Any) -> None:
        inputs, target = tuple(wish.inputs), wish.recording().target
        _understood(Request(wish.stage, wish.flags, wish.overrides, inputs, wish.seed, target))

    monkeypatch.setattr("r2s2r_cli.commands.resumable_run.ResumableRun", computed)
    monkeypatch.setattr("r2s2r_cli.commands.stage.StageRun", computed)
    monkeypatch.setattr("r2s2r_cli.commands.record_run.carry_out", recorded)
    monkeypatch.setattr("r2s2r_cli.commands.plan_inputs.Asked.check", lambda *given: None)
    monkeypatch.setattr("r2s2r_cli.commands.execute_outcome.expect", lambda *given, **named: None)
    monkeypatch.setattr(sys.modules["r2s2r_cli.commands.execute"], "_require_fresh", lambda *given: None)
    return root


def asked(*words: str) -> Request:
    """What the command line makes of these words."""
    HEARD.clear()
    result = invoke(*words)
    assert HEARD, (words, result.stderr)
    return HEARD[0]


def again(request: Request, *, force: bool = False) -> list[str]:
    """The words of the command that asks for the same."""
    made = builders.provenance(
        stage=request.stage, settings={"flags": dict(request.flags)}, overrides=dict(request.overrides),
        inputs=request.inputs, seed=request.seed,
    )  # fmt: skip
    return shlex.split(command_again(made, request.target, force=force))[1:]


@pytest.mark.parametrize("stage", STAGE_VERSIONS)
def test_it_asks_for_the_same(sample: Path, stage: str) -> None:
    """A command with every option there is, through what provenance keeps of it, and back through the command line."""
    force = ("--force",) if stage in ("record", "execute") else ()
    one = asked(stage, *ASKED[stage], *force)
    words = again(one, force=bool(force))
    confirmed = ["--yes"] if stage == "execute" else []  # asking is no part of the request
    assert asked(*words, *confirmed) == one
    assert again(asked(*words, *confirmed), force=bool(force)) == words


@pytest.mark.parametrize("stage", STAGE_VERSIONS)
def test_no_option_is_forgotten(stage: str) -> None:
    """Every option that says what to do is one that the command knows, and is asked for above."""
    params = [one for one in commands()[stage].params if one.param_type_name == "option"]
    names = {word: one.name for one in params for word in (*one.opts, *one.secondary_opts)}
    what = set(names.values()) - (HOW - {"iteration"} if stage == "floor" else HOW) - WITHOUT_ARTIFACT
    assert {names[word] for word in ASKED[stage] if word.startswith("--")} & what == what
    assert {names[f"--{option}"] for option, _, _ in OPTIONS[stage]} == what - BY_SETTING


@pytest.mark.parametrize("stage", STAGE_VERSIONS)
def test_what_is_usual_is_not_typed(sample: Path, stage: str) -> None:
    """A command without options comes back without any, but for the iteration and what decides the runs."""
    needed = {"import": ("c.csv",), "record": ("policies/walk.toml", "--port", "p", "--force"),
              "simulate": ("--random", "3"), "execute": ("--port", "p", "--yes", "--force"),
              "calibrate": ("--points", "points.csv"), "estimate": ("--iteration", "1")}.get(stage, ())  # fmt: skip
    one = asked(stage, *needed)
    words = [word for word in again(one) if word not in needed]
    latest = ["--iteration", "2"] if one.target.parent.name == "002" else []
    own = {"execute": ["--model", "iterations/002/30-identify.h5"]}.get(stage, [])
    assert words == [stage, *own, *latest]


def test_what_an_older_comparison_selected_is_typed(sample: Path) -> None:
    """It does not say what was typed: all of it is, so that the same is made again."""
    one = asked("compare", "--iteration", "1")
    older = {name: value for name, value in one.flags.items() if name != "given"}
    words = ["compare", "--model", f"iteration 1={MODEL}", "--of", "execute", "--iteration", "1"]
    assert again(replace(one, flags=older)) == words


def test_settings_keep_their_types(sample: Path) -> None:
    """A text that looks like a number stays a text, a list a list."""
    values = {"estimate.a": "0.5", "estimate.b": "fast one", "estimate.c": [1, 2.5e-7], "estimate.d": True}
    made = builders.provenance(stage="estimate", overrides=values, inputs=())
    words = shlex.split(command_again(made, Path("iterations/001/20-estimate.h5").absolute()))
    assert parse_overrides([word for word in words if word.startswith("estimate.")], "estimate") == values


def test_policies_are_named_from_the_project(sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Typed in a folder of the project, they come back as they are typed in the project's directory."""
    monkeypatch.chdir(sample / "policies")
    for stage, more in (("simulate", ()), ("record", ("--port", "p", "--force")),
                        ("execute", ("--port", "p", "--yes", "--force"))):  # fmt: skip
        assert asked(stage, "walk.toml", *more).flags["policies"] == ["policies/walk.toml"]


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        ("replay:films", "replay:policies/films"),
        ("replay:../iterations/001/10-record.h5", "replay:iterations/001/10-record.h5"),
        ("replay:../iterations/001/10-record.h5:walk", "replay:iterations/001/10-record.h5:walk"),
        ("replay:{root}/policies/films/", "replay:policies/films"),
        ("replay:.", "replay:policies"),
        ("replay:../link", "replay:link"),
        ("replay:../../elsewhere/films", "replay:{root.parent}/elsewhere/films"),
        ("rig://127.0.0.1:9", "rig://127.0.0.1:9"),
        ("realsense", "realsense"),
    ],
)
def test_a_played_back_camera_is_found_from_the_project(
    sample: Path, monkeypatch: pytest.MonkeyPatch, typed: str, kept: str
) -> None:
    """Typed in a folder of the project, in it or not, it comes back as it is typed in the project's directory: there
    the command that makes the recording again asks for the same pictures. No path of this machine for what is in it."""
    (sample.parent / "elsewhere" / "films").mkdir(parents=True)
    (sample / "link").symlink_to(sample.parent / "elsewhere" / "films")
    for stage, more in (("record", ("--port", "p", "--force")), ("execute", ("--port", "p", "--yes", "--force"))):
        monkeypatch.chdir(sample / "policies")
        one = asked(stage, "walk.toml", "--camera", typed.format(root=sample), *more)
        assert one.flags["camera"] == kept.format(root=sample)
        monkeypatch.chdir(sample)
        confirmed = ["--yes"] if stage == "execute" else []
        assert asked(*again(one, force=True), *confirmed).flags["camera"] == one.flags["camera"]


def test_iterations_are_told_from_projects_by_where_they_lie(tmp_path: Path) -> None:
    """A project in a folder called 2026 is no iteration; a file named from within its iteration is of that."""
    made = builders.provenance(stage="floor", inputs=())
    assert command_again(made, tmp_path / "2026" / "floor.h5") == "r2s2r floor"
    made = builders.provenance(stage="plan", inputs=())
    assert command_again(made, tmp_path / "iterations" / "012" / "40-plan.h5") == "r2s2r plan --iteration 12"


def test_another_programs_artifact_has_its_own_command() -> None:
    """What was collected by a script is made again by that, not by a command that there is not."""
    made = builders.provenance(stage="collect", argv=("make.py", "out dir"))
    assert command_again(made, Path("policies.h5")) == "make.py 'out dir'"


def test_every_stage_is_known() -> None:
    """A new stage says what makes it again."""
    assert set(OPTIONS) == set(STAGE_VERSIONS) == set(ASKED)
    assert set(OPTIONS) <= set(COMMANDS)

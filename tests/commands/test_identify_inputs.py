"""What `identify` is asked for: iterations, intervals, parameters; its document; what it refuses before it fits."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
import typer

from r2s2r_cli.commands.identify import _answer, identify
from r2s2r_cli.commands.identify_inputs import Asked, parse_fixed
from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.again import command_again
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Project
from schemas.config import IdentifySettings
from schemas.results import StageResult
from tests.commands.conftest import invoke
from tests.stages.identify.reports import report
from tests.support import builders

ESTIMATE = "iterations/001/20-estimate.h5"


def asked(root: Path, number: int | None = None, **options: Any) -> Asked:
    """The request in a project."""
    project = Project.find(root)
    return Asked(project, project.iteration(number, create=True), **options)


def test_show_config_lists_the_settings(estimated: Path) -> None:
    """The effective settings as a section of project.toml; --starts is one of them."""
    shown = invoke("identify", "--show-config", "--starts", "7").stdout
    assert "starts = 7" in shown and "train_share = 0.65" in shown


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        (("--method", "papier"), 2, "--method paper"),
        (("--drive", "close-loop"), 2, "--drive closed-loop"),
        (("--iteration", "0"), 2, "no such iteration number"),
        (("--also", "7"), 2, "iteration 7 does not exist"),
        (("--train", "sampel:1-2"), 2, "--train sample:1-2"),
        (("--train", "sample:1-99"), 2, "an interval does not exist"),
        (("--train", "sample:1-2", "--test", "sample:2-3"), 2, "--train sample:1"),
        (("--train", "sample:1", "--fix", "friction"), 2, "--fix friction=0.6"),
        (("--set", "identify.starts=0"), 2, "identify.starts"),
        (("--set", "identify.start=3"), 2, "identify.start"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(
    estimated: Path, arguments: tuple[str, ...], code: int, expected: str
) -> None:
    """With its exit code, in words, a hint that can be pasted, and nothing is written."""
    result = invoke("identify", *arguments, "--no-draw")
    assert result.exit_code == code, result.stderr
    assert expected in result.stderr
    assert result.stderr.splitlines()[-1].startswith("hint: ")
    assert not list(estimated.rglob("30-identify*"))


def test_without_an_estimate_the_hint_is_to_estimate(project: Path) -> None:
    """A new project has nothing to learn from: exit code 4, and what to run."""
    result = invoke("identify")
    assert result.exit_code == 4
    assert result.stderr.splitlines()[-1] == "hint: r2s2r import sample.csv --iteration 1"


def test_runs_of_another_robot_are_refused(estimated: Path) -> None:
    """Exit code 4 before any fit, in a dry run too; it says whose they are."""
    robot = estimated / "robot.toml"
    robot.write_text(robot.read_text().replace('name = "threebar"', 'name = "another"', 1))
    result = invoke("identify", "--dry-run")
    assert result.exit_code == 4
    assert "run sample is of another robot" in result.stderr and "received: threebar" in result.stderr


def test_a_dry_run_says_what_it_would_read(estimated: Path) -> None:
    """Recording and estimate are the inputs; the document has the keys that others rely on, without numbers yet."""
    result = invoke("identify", "--dry-run", "--json", "--train", "sample:1")
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert document["state"] == "dry_run"
    assert document["inputs"] == ["iterations/001/10-record.h5", ESTIMATE]
    assert [document[key] for key in ("parameters", "train", "heldout", "wall_s", "rollouts")] == [None] * 5


def test_the_document_has_the_numbers_at_the_top() -> None:
    """Its own keys beside those of every stage."""
    said = report(builders.identification())
    stage = StageResult(stage="identify", state="done", artifact="a.h5", content_sha256=None, reasons=(), inputs=(),
                        report=said.model_dump(mode="json"))  # fmt: skip
    document = json.loads(_answer(stage, said).model_dump_json(by_alias=True))
    assert document["schema"] == "r2s2r.identify/1"
    assert set(document["parameters"]["friction"]) >= {"value", "sd", "lower", "upper", "range", "unit", "identifiable"}
    assert set(document["heldout"]) >= {"keyframe_cap_rmse_m", "free_run_cap_mean_m", "baselines", "floor_m"}
    assert document["train"]["keyframe_cap_rmse_m"] == 0.006
    assert (document["wall_s"], document["rollouts"]) == (3.5, 120)
    assert document["parameters"]["restitution"]["sd"] is None
    assert document["report"]["parameters"] == document["parameters"]


def test_an_iteration_without_an_estimate_learns_from_the_one_before(estimated: Path) -> None:
    """Iteration 3 takes iteration 1 where 2 has nothing; its runs keep their names."""
    (estimated / "iterations" / "002").mkdir()
    found = asked(estimated, 3)
    assert [source.place.number for source in found.sources] == [1]
    assert [run.name for run in found.runs()] == ["sample"]
    assert [ref.path for ref in found.refs()] == ["iterations/001/10-record.h5", ESTIMATE]


def test_the_next_iteration_learns_from_recorded_and_executed_runs(estimated: Path) -> None:
    """Design section 2: iteration N + 1 takes 20 and 51 of iteration N; equal names are told apart."""
    folder = estimated / "iterations" / "001"
    shutil.copy(folder / "10-record.h5", folder / "50-execute.h5")
    shutil.copy(folder / "20-estimate.h5", folder / "51-estimate.h5")
    (estimated / "iterations" / "002").mkdir()
    found = asked(estimated, 2)
    assert [run.name for run in found.runs()] == ["sample", "executed-sample"]
    assert [ref.path for ref in found.refs()] == [
        "iterations/001/10-record.h5", ESTIMATE, "iterations/001/50-execute.h5", "iterations/001/51-estimate.h5",
    ]  # fmt: skip
    assert [source.executed for source in asked(estimated, 1).sources] == [False]  # what it planned came later


def test_runs_of_other_iterations_carry_their_number(estimated: Path) -> None:
    """--also adds the runs of iteration 1 to those of iteration 2, told apart by name, each once."""
    shutil.copytree(estimated / "iterations" / "001", estimated / "iterations" / "002")
    found = asked(estimated, 2, also=(1, 1))
    assert [run.name for run in found.runs()] == ["sample", "001-sample"]
    assert len(found.refs()) == 4


def test_online_goes_on_from_the_last_identification(estimated: Path) -> None:
    """The identification of an earlier iteration becomes an input; without one the fit begins at robot.toml."""
    from r2s2r_cli.store.write import write_artifact

    later = asked(estimated, 2, online=True)
    assert later.last is None and len(later.refs()) == 2
    write_artifact(estimated / "iterations/001/30-identify.h5", builders.identification(), builders.provenance())
    later = asked(estimated, 2, online=True)
    assert later.last is not None and later.last.number == 1
    request = later.request(later.runs(), IdentifySettings())
    assert request.before is not None and request.before.kind == "identification"
    assert asked(estimated, 1, online=True).last is None


def test_an_iteration_of_also_that_is_not_there_is_named_so(estimated: Path) -> None:
    """Where: --also, not --iteration, which was not typed."""
    refused = invoke("identify", "--also", "5", "--dry-run")
    assert refused.exit_code == 2 and "where: --also" in refused.stderr, refused.stderr


def test_an_iteration_is_not_added_to_itself(estimated: Path) -> None:
    """Its runs are used anyway: exit code 2 and the same without it; a later one that learns from it may name it."""
    error = json.loads(invoke("identify", "--also", "1", "--seed", "4", "--dry-run", "--json").stdout)
    assert (error["exit_code"], error["where"], error["received"]) == (2, "--also", "1")
    assert error["hint"] == "r2s2r identify --seed 4 --json --dry-run"
    assert invoke(*shlex.split(error["hint"])[1:]).exit_code == 0
    assert [run.name for run in asked(estimated, 2, also=(1,)).runs()] == ["sample"]


def test_intervals_are_resolved(estimated: Path) -> None:
    """--train 1-2 leaves the other complete intervals to be predicted."""
    found = asked(estimated, train=("sample:1-2",))
    request = found.request(found.runs(), IdentifySettings())
    assert [one.intervals for one in request.train] == [(1, 2)]
    assert request.test[0].intervals[0] == 3


def test_a_dry_run_checks_what_is_asked_for(estimated: Path) -> None:
    """Names, runs, intervals and what goes together: the same refusal and code as that of the fit."""
    for typed, expected in {
        "--free frictoin": "--free friction",
        "--fix frictoin=1 --free mass": "--free mass --fix friction=1 --dry-run",
        "--fix restitutoin=0.2": "--fix restitution=0.2 --dry-run",
        "--free +frictoin=0.4,0.1..0.9": "--free +friction=0.4,0.1..0.9 --dry-run",
        "--with-effect motor_leg": "--with-effect motor_lag --dry-run",
        "--with-effect dropout": "--dry-run",
        "--with-effect dropout --with-effect payload": "--with-effect payload --dry-run",
        "--train sampel:1-2 --seed 3": "--seed 3 --train sample:1-2",
        "--method cma --drive closed-loop": "--drive closed-loop --dry-run   #",
        "--method cma --online": "--online",
        "--self-test --free frictoin": "--self-test --free friction",
    }.items():
        result = invoke("identify", *typed.split(), "--dry-run")
        assert result.exit_code == 2, (typed, result.stderr)
        assert result.stderr.splitlines()[-1].startswith(f"hint: r2s2r identify {expected}"), (typed, result.stderr)
    assert invoke("identify", "--free", "friction=2,3..1", "--dry-run").exit_code == 2
    alone = invoke("identify", "--online", "--dry-run")
    assert alone.exit_code == 4 and alone.stderr.endswith(
        "hint: r2s2r identify --dry-run   # without --online: from robot.toml\n"
    )
    for method in ((), ("--method", "paper"), ("--drive", "closed-loop")):
        # All are judged by command replay, the paper's fit after it has ended.
        result = invoke("identify", *method, "--free", "com.0", "--dry-run")
        assert "cannot be free in command replay" in result.stderr, method
    result = invoke("identify", "--method", "paper", "--free", "command_delay", "--dry-run")
    assert "has no derivative in the paper's method" in result.stderr
    assert invoke("identify", "--test", "sample:99", "--dry-run").exit_code == 2


def test_a_run_without_motion_is_looked_at_where_it_lies(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that the hint names exists, seen from where the command was given."""
    import r2s2r_cli.stages.identify.load as load

    monkeypatch.setattr(load, "STILL", 1e9)
    monkeypatch.chdir(estimated / "iterations")
    result = invoke("identify")
    assert result.exit_code == 4 and "nothing moves" in result.stderr
    path = result.stderr.splitlines()[-1].split()[3]
    assert path == "001/20-estimate.h5" and Path(path).is_file()


def test_a_wrong_request_is_said_while_another_writes(estimated: Path) -> None:
    """To wait for the other one would not mend it; a right one waits."""
    with writing(estimated, "identify"):
        result = invoke("identify", "--train", "sampel:1-2")
        assert result.exit_code == 2 and "another r2s2r" not in result.stderr
        assert result.stderr.splitlines()[-1] == "hint: r2s2r identify --train sample:1-2"
        assert "another r2s2r is writing" in invoke("identify", "--train", "sample:1-2").stderr


def test_fixed_values_are_numbers() -> None:
    """NAME=VALUE, finite."""
    assert parse_fixed(("friction=0.6", "mass.0=1e-1")) == {"friction": 0.6, "mass.0": 0.1}
    for text in ("friction", "friction=", "=1", "friction=nan", "friction=a"):
        with pytest.raises(UsageError, match="no number"):
            parse_fixed((text,))


def test_what_the_settings_fix_a_command_may_free_or_fix_otherwise(estimated: Path) -> None:
    """`identify.fix` holds like --fix; a number without a value is refused where it stands."""
    settings = IdentifySettings(fix=("damping_actuated=40", "friction=0.6"))
    for given, fixed in (
        ({}, {"damping_actuated": 40.0, "friction": 0.6}),
        ({"free": ("+friction",)}, {"damping_actuated": 40.0}),
        ({"fix": ("friction=0.5",)}, {"damping_actuated": 40.0, "friction": 0.5}),
    ):
        found = asked(estimated, train=("sample:1-2",), **given)
        assert found.request(found.runs(), settings).fixed == fixed
    with pytest.raises(UsageError, match="no number") as caught:
        asked(estimated).request(asked(estimated).runs(), IdentifySettings(fix=("friction",)))
    assert caught.value.where == "identify.fix"


def test_the_command_that_makes_it_again(estimated: Path) -> None:
    """All options that were given come back, in a form that the command line reads as the same request."""
    given = {"train": ("sample:1-2",), "test": ("sample:3",), "free": ("friction=0.5,0.2..1.5,~0.3", "mass"),
             "fix": ("restitution=0.1",), "effects": ("motor_lag",), "method": "cma", "drive": "closed loop",
             "online": True, "also": (1,), "seed": 5}  # fmt: skip
    flags = asked(estimated, **given).flags()
    made = builders.provenance(stage="identify", settings={"flags": flags})
    words = shlex.split(command_again(made, estimated / "iterations/001/30-identify.h5"))
    assert words[:2] == ["r2s2r", "identify"]
    assert words[-2:] == ["--iteration", "1"]
    seen: dict[str, Any] = {}
    app = typer.Typer()
    app.command()(identify)
    command = typer.main.get_command(app)
    with command.make_context("identify", words[2:]) as context:
        seen = context.params
    assert (tuple(seen["train"]), tuple(seen["free"]), tuple(seen["also"])) == (given["train"], given["free"], (1,))
    assert (seen["method"], seen["drive"], seen["online"], seen["seed"]) == ("cma", "closed-loop", True, 5)
    assert (seen["fix"], seen["with_effect"], seen["test"]) == (["restitution=0.1"], ["motor_lag"], ["sample:3"])
    assert command_again(builders.provenance(stage="identify", settings={"flags": asked(estimated).flags()}),
                         estimated / "iterations/001/30-identify.h5") == "r2s2r identify --iteration 1"  # fmt: skip

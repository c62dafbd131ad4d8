"""What cannot be diagnosed: the exit code, the reason, one line that helps, and nothing written."""

from __future__ import annotations

import dataclasses
import json
import shlex
import shutil
from pathlib import Path

import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.diagnose_inputs import Asked
from r2s2r_cli.commands.named_runs import nearest_run, require_robot
from r2s2r_cli.errors import InputError
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
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


def test_a_wrong_request_is_said_while_another_writes(estimated: Path) -> None:
    """To wait for the other one would not mend it; a right one waits."""
    asked(estimated)
    with writing(estimated, "identify"):
        refused = invoke("diagnose", "--healthy", "smaple")
        assert refused.exit_code == 2, refused.stderr
        assert refused.stderr.splitlines()[-1] == "hint: r2s2r diagnose --healthy sample"
        assert "another r2s2r is writing" in invoke("diagnose").stderr


def second(root: Path, *names: str) -> Path:
    """A second iteration with the run of the first under these names of artifacts."""
    folder = root / "iterations/002"
    folder.mkdir()
    for name in names:
        source = {"10": "10-record.h5", "50": "10-record.h5"}.get(name[:2], "20-estimate.h5")
        shutil.copy(root / "iterations/001" / source, folder / name)
    return folder


def hint(*typed: str) -> str:
    """The hint of a diagnosis that is refused."""
    refused = invoke("diagnose", *typed, "--dry-run")
    assert refused.exit_code in (2, 4), refused.stderr
    found: str = refused.stderr.splitlines()[-1].removeprefix("hint: ")
    return found


def accepted(command: str) -> str:
    """What a dry run says that was pasted from a hint."""
    done = invoke(*shlex.split(command, comments=True)[1:])
    assert done.exit_code == 0, done.stderr
    said: str = done.stderr
    return said


def test_runs_without_an_identification_are_diagnosed_with_that_of_an_earlier_iteration(estimated: Path) -> None:
    """Not with one of their own, which may take up what is wrong with them; pasted, the hint is accepted."""
    asked(estimated)
    folder = second(estimated, "10-record.h5", "20-estimate.h5")
    assert hint("--seed", "4") == "r2s2r diagnose --seed 4 --iteration 1 --also 2 --dry-run"
    accepted(hint())
    with_model = hint("--also", "1")
    assert with_model == "r2s2r diagnose --also 1 --model iterations/001/30-identify.h5 --dry-run"
    accepted(with_model)
    for path in folder.iterdir():
        path.unlink()
    assert hint() == "r2s2r diagnose --iteration 1 --dry-run"  # which it has no runs beside


def test_what_an_identification_of_healthy_runs_leaves_is_split_as_usual(estimated: Path) -> None:
    """One run that it does not know, beside healthy ones alone: fitted and judged are its own intervals, and said."""
    one = asked(estimated)
    assert [part.run for part in one.evidence().fit] == ["sample"]  # as typed
    made = identification(one.project.robot())
    table = made.groups["segments"]
    table["run"][:] = b"samp"  # the field is as wide as `walk`
    estimate = read_artifact(estimated / "iterations/001/20-estimate.h5", "estimate")[1]
    recording = read_artifact(estimated / "iterations/001/10-record.h5", "recording")[1]
    for data, name in ((estimate, "20-estimate.h5"), (recording, "10-record.h5")):
        own = {path.replace("runs/sample", "runs/samp"): group for path, group in data.groups.items()}
        write_artifact(estimated / "iterations/001" / name, ArtifactData(data.kind, own), provenance())
    write_artifact(estimated / "iterations/001/30-identify.h5", made, provenance())
    folder = second(estimated)
    for data, name in ((estimate, "20-estimate.h5"), (recording, "10-record.h5")):
        write_artifact(folder / name, data, provenance())
    said = accepted("r2s2r diagnose --iteration 1 --healthy samp --also 2 --dry-run")
    assert "the identification was fitted to healthy runs alone: here 002-sample:1-" in said


def test_where_all_runs_are_healthy_others_are_named(estimated: Path) -> None:
    """Of an iteration that has some, else how to record them: where there are none yet, with what reaches a robot."""
    asked(estimated)
    assert hint("--healthy", "sample") == (
        "r2s2r record --random 15 --repeats 3 --iteration 2 --port /dev/ttyUSB0 --protocol legacy --camera realsense"
        "   # then estimate it, name it here"
    )
    second(estimated, "10-record.h5", "20-estimate.h5")
    beside = hint("--iteration", "1", "--healthy", "sample")
    assert beside == "r2s2r diagnose --healthy sample --iteration 1 --also 2 --dry-run"
    accepted(beside)


def test_a_healthy_run_is_meant_by_a_part_of_its_name() -> None:
    """`after` is 002-after, though crawl is there as well; a slip of the finger is what it is spelt like."""
    known = ["crawl", "straight", "002-after"]
    assert nearest_run("after", known) == "002-after"
    assert nearest_run("craw", known) == "crawl" and nearest_run("strait", known) == "straight"


def test_executed_runs_of_the_iteration_are_not_said_to_be_used(estimated: Path) -> None:
    """They are from a later iteration on, and the hint is of one that is there, or that `identify` begins."""
    asked(estimated)
    for name, of in (("50-execute.h5", "10-record.h5"), ("51-estimate.h5", "20-estimate.h5")):
        shutil.copy(estimated / "iterations/001" / of, estimated / "iterations/001" / name)
    refused = invoke("diagnose", "--also", "1")
    assert "its executed ones (51-estimate.h5) from the next iteration on" in refused.stderr
    first = hint("--also", "1")
    assert first == "r2s2r identify --iteration 2   # of both; then: r2s2r diagnose --iteration 2"
    accepted(f"{first.partition('   #')[0]} --dry-run")
    second(estimated)
    later = hint("--iteration", "1", "--also", "1")
    assert later == "r2s2r diagnose --iteration 2 --model iterations/001/30-identify.h5 --dry-run"
    accepted(later)
    of_both = [run.name for run in dataclasses.replace(
        asked(estimated), iteration=Project.find(estimated).iteration(2), model=Path("iterations/001/30-identify.h5"),
    ).evidence().runs]  # fmt: skip
    assert of_both == ["sample", "executed-sample"]


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

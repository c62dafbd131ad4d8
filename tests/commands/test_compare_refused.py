"""Runs that cannot be compared: exit code 4 with the reason, nothing written; beside good runs they are left out."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.compare_inputs import Asked
from r2s2r_cli.stages.compare.runs import real_runs
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.write import write_artifact
from tests.commands.conftest import document, invoke
from tests.support import builders
from tests.support.identified import identification

Groups = dict[str, Group]
Spoil = Callable[[Groups], None]


def walked() -> Groups:
    """The builders' run, both of its intervals complete, opening with a gait."""
    groups = dict(builders.estimate().groups)
    groups["runs/walk/intervals"]["complete"][:] = True
    groups["runs/walk/intervals"]["target"][0, 0] = 0.5
    del groups["runs/walk/policy"]
    return groups


def rows(data: Groups, name: str, count: int) -> None:
    """Keep the first rows of every dataset of a group of the run."""
    group = data[f"runs/walk/{name}"]
    data[f"runs/walk/{name}"] = Group({k: group[k][:count] for k in group.datasets}, group.attributes)


def empty(data: Groups) -> None:
    """No frame, no target."""
    for name in ("frames", "intervals", "segments"):
        rows(data, name, 0)


def without_targets(data: Groups) -> None:
    """A log of a robot that somebody moved by hand."""
    for name in ("intervals", "segments"):
        del data[f"runs/walk/{name}"]


def one_segment(data: Groups) -> None:
    """The robot was stopped in its first shape."""
    for name in ("intervals", "segments"):
        rows(data, name, 1)


def one_segment_after_rest(data: Groups) -> None:
    """The rest shape and one more: nothing follows that would make it a gait."""
    data["runs/walk/intervals"]["target"][0] = 1.0


def other_robot(data: Groups) -> None:
    """Recorded with the six-bar one."""
    root = data["runs/walk"]
    data["runs/walk"] = replace(root, attributes={**root.attributes, "robot": "sixbar"})


def nowhere(data: Groups) -> None:
    """Where the robot was at first is not a number."""
    data["runs/walk/frames"]["p_WE"][0, 2] = np.nan


CASES = [
    (empty, "run walk has no gait to compare", "received: 0"),
    (without_targets, "run walk has no gait to compare", "received: 0"),
    (one_segment, "run walk has no gait to compare", "received: 1"),
    (one_segment_after_rest, "run walk has no gait to compare", "received: 1"),
    (other_robot, "run walk is of another robot", "received: sixbar"),
    (nowhere, "run walk starts nowhere", "cap 2"),
]


@pytest.mark.parametrize(("spoil", "what", "received"), CASES, ids=[spoil.__name__ for spoil, _, _ in CASES])
def test_a_run_that_cannot_be_compared_is_refused(project: Path, spoil: Spoil, what: str, received: str) -> None:
    """In the project of its robot, as the only run."""
    data = walked()
    spoil(data)
    folder = project / "iterations" / "001"
    folder.mkdir(parents=True, exist_ok=True)
    write_artifact(folder / "51-estimate.h5", ArtifactData("estimate", data), builders.provenance(inputs=()))
    result = invoke("compare", "--project", str(project))
    assert result.exit_code == 4, result.stderr
    assert what in result.stderr and received in result.stderr and "hint:" in result.stderr
    assert not list(folder.glob("60-*"))


@pytest.mark.parametrize(("spoil", "what", "received"), CASES, ids=[spoil.__name__ for spoil, _, _ in CASES])
def test_beside_good_runs_it_is_left_out_with_the_reason(spoil: Spoil, what: str, received: str) -> None:
    """The others are compared."""
    data = walked()
    spoil(data)
    good = {path.replace("walk", "good"): group for path, group in walked().items()}
    runs, said = real_runs(
        ArtifactData("estimate", {**data, **good}), None, builders.robot(), iteration=3, prefix="003-"
    )
    assert [run.name for run in runs] == ["003-good"]
    assert [run.iteration for run in runs] == [3]
    assert len(said) == 1 and what in said[0] and received.removeprefix("received: ") in said[0]


def test_a_simulator_without_a_file_is_named_with_one(estimated: Path) -> None:
    """The name stays and the file follows it, in the command as typed; without any identification, what makes one."""
    nothing = invoke("compare", "--of", "record", "--model", "before=", "--dry-run")
    assert nothing.exit_code == 2 and nothing.stderr.endswith("hint: r2s2r identify\n")
    write_artifact(
        estimated / "iterations/001/30-identify.h5",
        identification(Project.find(estimated).robot()),
        builders.provenance(),
    )
    for typed in (("--model", "before="), ("--model=before=",), ("--model", "")):
        refused = invoke("compare", "--of", "record", *typed, "--dry-run")
        assert refused.exit_code == 2 and "a simulator has no file\n  where: --model" in refused.stderr
        mended = shlex.split(refused.stderr.splitlines()[-1])[2:]
        value = "iterations/001/30-identify.h5" if typed[-1] == "" else "before=iterations/001/30-identify.h5"
        option = [f"--model={value}"] if len(typed) == 1 else ["--model", value]
        assert mended == ["compare", "--of", "record", *option, "--dry-run"]
        assert invoke(*mended).exit_code == 0


@pytest.fixture
def learned(estimated: Path) -> Path:
    """The estimated sample, its working directory, with an identification of it at `a=b/30-identify.h5`."""
    data = identification(Project.find(estimated).robot())
    for folder in ("a=b", "²"):
        (estimated / folder).mkdir()
        write_artifact(estimated / folder / "30-identify.h5", data, builders.provenance())
    return estimated


def asked(project: Path, *models: str) -> dict[str, Path]:
    """The simulators that `--model` names."""
    here = Project.find(project)
    return Asked(here, here.iteration(1), models, "record").files


def test_a_file_that_is_there_is_not_split_at_its_equals_sign(learned: Path) -> None:
    """With a name before it or without; a file that is not there is split at the first sign."""
    file = Path("a=b/30-identify.h5")
    assert asked(learned, str(file)) == {"30-identify": file}
    assert asked(learned, f"the one={file}") == {"the one": file}
    assert asked(learned, "c=d=e.h5") == {"c": Path("d=e.h5")}
    result = document("compare", "--of", "record", "--model", str(file), "--dry-run")
    assert str(file) in result["inputs"]


@pytest.mark.parametrize("name", ["", " ", "real robot", "Real", "floor", "initial"])
@pytest.mark.parametrize("joined", [True, False])
def test_a_name_of_something_else_is_no_name_of_a_simulator(learned: Path, name: str, joined: bool) -> None:
    """Nothing, or what tables call the robot, its floor and the first simulator; the hint names it otherwise."""
    value = f"{name}=a=b/30-identify.h5"
    typed = [f"--model={value}"] if joined else ["--model", value]
    refused = invoke("compare", "--of", "record", *typed, "--dry-run")
    assert refused.exit_code == 2 and f"received: {value}" in refused.stderr
    mended = shlex.split(refused.stderr.splitlines()[-1])[2:]
    assert mended[:3] == ["compare", "--of", "record"] and mended[-1] == "--dry-run" and len(mended) == 4 + len(typed)
    assert invoke(*mended).exit_code == 0


def test_two_of_one_name_are_told_apart(learned: Path) -> None:
    """The second one gets another name, and keeps its file."""
    models = ["--model", "a=a=b/30-identify.h5", "--model", "a=²/30-identify.h5"]
    refused = invoke("compare", "--of", "record", *models, "--dry-run")
    assert refused.exit_code == 2 and "two simulators would have the same name" in refused.stderr
    mended = shlex.split(refused.stderr.splitlines()[-1])[2:]
    assert mended[3:7] == [*models[:3], "a-2=²/30-identify.h5"]
    assert invoke(*mended).exit_code == 0


def test_a_folder_called_by_a_digit_that_is_no_number_has_no_iteration(learned: Path) -> None:
    """`²` is a digit for Python and no number: the file gives the name, and no command a number."""
    assert asked(learned, "²/30-identify.h5") == {"30-identify": Path("²/30-identify.h5")}
    document("compare", "--of", "record", "--model", "²/30-identify.h5", "--dry-run")
    made = builders.provenance(stage="identify", stage_version=99)
    write_artifact(learned / "²" / "30-identify.h5", identification(Project.find(learned).robot()), made)
    for command in (["compare", "--of", "record"], ["simulate", "--random", "3"]):
        refused = invoke(*command, "--model", "²/30-identify.h5")
        assert refused.exit_code == 4 and refused.stderr.endswith("\nhint: r2s2r identify\n")


def test_a_dry_run_looks_at_what_a_simulator_is(estimated: Path) -> None:
    """States are no simulator: refused before anything is simulated, as the run itself would."""
    states = "iterations/001/20-estimate.h5"
    for words in (("--dry-run",), ()):
        refused = invoke("compare", "--of", "record", "--model", states, *words)
        assert refused.exit_code == 4 and "this artifact is of another kind" in refused.stderr
        assert refused.stderr.endswith(f"hint: r2s2r inspect {states}\n")

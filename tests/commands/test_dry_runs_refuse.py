"""A dry run refuses what the command would refuse: with its code, and before anything is computed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.plan.rewards import reward_named, try_out
from tests.commands.conftest import invoke
from tests.guards.listing import ROOT

SAMPLE = ROOT / "examples" / "sample-project" / "project"


@pytest.fixture
def sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the sample project as the working directory."""
    root = Path(shutil.copytree(SAMPLE, tmp_path / "project"))
    monkeypatch.chdir(root)
    return root


@pytest.mark.parametrize(
    ("typed", "code", "said"),
    [
        ("run nofile.csv --iteration 3", 4, "the CSV does not exist"),
        ("run points.csv --iteration 3 --repeats 0", 2, "this is no number of repeats"),
        ("run points.csv --iteration 3 --random 0", 2, "this is no length of a random policy"),
        ("simulate --random 100000000", 2, "this is no length of a random policy"),
        ("simulate iterations/001/40-plan.h5:straigth", 2, "there is no such policy"),
        ("simulate --replay nobody --iteration 1", 2, "there is no such run"),
        ("simulate --random 2 --from nobody --iteration 1", 2, "there is no such run"),
        ("plan --behaviour os:getcwd", 2, "the reward fails"),
        ("plan --behaviour builtins:len", 2, "the reward gives no number for every gait"),
    ],
)
def test_what_is_refused_is_refused_in_a_dry_run(sample: Path, typed: str, code: int, said: str) -> None:
    """The same words as without --dry-run; nothing is written."""
    before = sorted(sample.rglob("*"))
    result = invoke(*typed.split(), "--dry-run")
    assert result.exit_code == code, result.stderr
    assert said in result.stderr
    assert sorted(sample.rglob("*")) == before


def test_what_is_accepted_stays_accepted(sample: Path) -> None:
    """A policy, a replay, a start, and a model that are there."""
    words = ["policies/walk.toml", "--random", "3", "--replay", "walk", "--from", "rest", "--iteration", "1"]
    result = invoke("simulate", *words, "--model", "iterations/001/30-identify.h5", "--dry-run")
    assert result.exit_code == 0, result.stderr


def test_a_reward_is_tried_before_the_search() -> None:
    """Those of the paper pass; one that fails is no bug of ours."""
    try_out(reward_named("forward"))
    with pytest.raises(UsageError, match="the reward fails"):
        try_out(reward_named("os:getcwd"))

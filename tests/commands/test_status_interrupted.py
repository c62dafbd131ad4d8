"""`status` beside a computation: one that was interrupted can be gone on with, one that runs is left alone."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.commands.mend import Mending
from r2s2r_cli.commands.status import survey
from r2s2r_cli.commands.unfinished import Kept
from r2s2r_cli.store.checkpoint import CheckpointFile, checkpoint_of
from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Project
from schemas.results import ArtifactState
from tests.commands.conftest import invoke


@pytest.fixture
def bot(project: Path) -> Project:
    """With a checkpoint of a diagnosis in iteration 1."""
    found = Project.find(project)
    place = found.iteration(1, create=True)
    place.path.mkdir(parents=True)
    typed = ("diagnose", "--iteration", "1", "--healthy", "a b")
    CheckpointFile(checkpoint_of(place.artifact("diagnosis")), "0" * 64, command=typed).save({"cost": 1.0})
    return found


def test_what_was_interrupted_is_said_with_the_command_that_goes_on(bot: Project) -> None:
    """With the options of then. It makes nothing stale: a check passes."""
    found = survey(bot)
    assert [(one.stage, one.iteration, one.state) for one in found.artifacts] == [("diagnose", 1, "interrupted")]
    assert found.next == "r2s2r diagnose --iteration 1 --healthy 'a b' --resume"
    assert found.next in found.artifacts[0].reasons[0]
    shown = next(line for line in invoke("status").stdout.splitlines() if "70-diagnose.partial" in line)
    assert "--resume" in shown  # in the first line of its cell, wherever that breaks the command
    assert invoke("status", "--check").exit_code == 0


def test_an_iteration_that_is_no_longer_the_latest_is_named(project: Path) -> None:
    """As typed it would go on with another one."""
    found = Project.find(project)
    place = found.iteration(1, create=True)
    place.path.mkdir(parents=True)
    CheckpointFile(checkpoint_of(place.artifact("plan")), "0" * 64, command=("plan", "--seed", "2")).save({"cost": 1.0})
    assert survey(found).next == "r2s2r plan --seed 2 --resume"
    found.iteration(2, create=True).path.mkdir()
    assert survey(found).next == "r2s2r plan --seed 2 --iteration 1 --resume"


def test_what_runs_is_no_wreck(bot: Project) -> None:
    """Nothing is hinted to be gone on with from under its writer; beside another command it is interrupted still, and
    has to wait."""
    for command, state in (("diagnose", "running"), ("record", "interrupted")):
        with writing(bot.root, command):
            found = survey(bot)
        assert [one.state for one in found.artifacts] == [state]
        assert ("is at work" in found.artifacts[0].reasons[0]) == (state == "running")
        assert "--resume" not in found.next


def test_arrays_and_values_say_how_to_go_on(tmp_path: Path) -> None:
    """Both kinds of checkpoints; those of an older r2s2r name stage and iteration alone. From one whose head is damaged
    nothing goes on: it is in the way."""
    name = "iterations/002/40-plan.partial"
    path = tmp_path / "40-plan.partial"
    ArrayCheckpoint(path, "0" * 64, command=("plan", "--to", "1,2,0")).keep(b"0" * 32, [np.zeros(3)])
    assert Kept(path, name, "plan", 2).command == "r2s2r plan --to 1,2,0 --resume"
    path.write_text('{"form": 1, "key": "0", "values": {}}')
    assert Kept(path, name, "plan", 2).command == "r2s2r plan --iteration 2 --resume"
    for damaged in (bytes(range(256)), bytes(1000), b"", b"[]", b"{}"):
        path.write_bytes(damaged)
        assert Kept(path, name, "plan", 2).command == f"rm {name}"
        assert "nothing goes on from it" in Kept(path, name, "plan", 2).use


def test_what_is_damaged_is_not_gone_on_with(bot: Project) -> None:
    """Neither by the survey, which says what removes it, nor instead of what mends an artifact."""
    kept = checkpoint_of(bot.iteration(1).artifact("diagnosis"))
    kept.write_bytes(bytes(kept.stat().st_size))
    found = survey(bot)
    assert found.next == f"rm {bot.relative(kept)}"
    assert "its head is damaged" in found.artifacts[0].reasons[0]
    bot.iteration(1).artifact("diagnosis").write_bytes(b"")
    assert survey(bot).next.startswith("r2s2r diagnose") and "--resume" not in survey(bot).next


def test_nothing_is_made_anew_over_what_is_kept(bot: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a stale artifact has a checkpoint, going on is what mends it; other stages are mended before."""
    place = bot.iteration(1)
    states = [
        (ArtifactState(stage=stage, iteration=1, artifact=name, state="stale", reasons=("old",), bytes=1,
                       content_sha256=None), Mending(f"r2s2r {stage} --iteration 1"))
        for stage, name in (("estimate", "20-estimate.h5"), ("diagnose", "70-diagnose.h5"))
    ]  # fmt: skip
    given = iter(states)
    monkeypatch.setattr(Project, "artifacts", lambda _: [place.path / "20-estimate.h5", place.path / "70-diagnose.h5"])
    monkeypatch.setattr(sys.modules[survey.__module__], "_state", lambda *_: next(given))
    assert survey(bot).next == "r2s2r estimate --iteration 1"
    given = iter(states[1:])
    monkeypatch.setattr(Project, "artifacts", lambda _: [place.path / "70-diagnose.h5"])
    assert survey(bot).next == "r2s2r diagnose --iteration 1 --healthy 'a b' --resume"


def test_what_can_be_recovered_is_recovered_before_work_goes_on(bot: Project) -> None:
    """A damaged diagnosis beside a checkpoint of the next: to recover one loses nothing of the other. One with nothing
    in it is gone on with, since made anew what is kept would be lost."""
    place = bot.iteration(1).artifact("diagnosis")
    place.write_bytes(bytes(4096) + b"\x89HDF\r\n\x1a\n" + bytes(100))
    assert survey(bot).next == "r2s2r recover iterations/001/70-diagnose.h5"
    place.write_bytes(b"")
    assert survey(bot).next == "r2s2r diagnose --iteration 1 --healthy 'a b' --resume"

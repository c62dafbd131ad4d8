"""`status` beside a computation: one that was interrupted can be gone on with, one that runs is left alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.commands.status import survey
from r2s2r_cli.store.checkpoint import CheckpointFile, checkpoint_of
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Project
from tests.commands.conftest import invoke


@pytest.fixture
def bot(project: Path) -> Project:
    """With a checkpoint of a diagnosis in iteration 1."""
    found = Project.find(project)
    place = found.iteration(1, create=True)
    place.path.mkdir(parents=True)
    CheckpointFile(checkpoint_of(place.artifact("diagnosis")), "0" * 64).save({"cost": 1.0})
    return found


def test_what_was_interrupted_is_said_with_the_command_that_goes_on(bot: Project) -> None:
    """It makes nothing stale: a check passes."""
    found = survey(bot)
    assert [(one.stage, one.iteration, one.state) for one in found.artifacts] == [("diagnose", 1, "interrupted")]
    assert found.next == "r2s2r diagnose --iteration 1 --resume" and "--resume" in found.artifacts[0].reasons[0]
    assert invoke("status", "--check").exit_code == 0


def test_what_runs_is_no_wreck(bot: Project) -> None:
    """Nothing is hinted to be gone on with from under its writer."""
    with writing(bot.root, "diagnose"):
        found = survey(bot)
    assert [one.state for one in found.artifacts] == ["running"] and "r2s2r diagnose" in found.artifacts[0].reasons[0]
    assert "--resume" not in found.next

"""Work that failed is no work that was interrupted: nothing offers to go on with what must fail again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.commands.interrupts import resumable
from r2s2r_cli.commands.status import survey
from r2s2r_cli.errors import ArtifactError, Interrupted, NumericalError
from r2s2r_cli.store.checkpoint import CheckpointFile, checkpoint_of, failed_of
from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
from r2s2r_cli.store.project import Iteration, Project

KEY, OTHER = "0" * 64, "1" * 64
HINT = "r2s2r plan --resume"
NUMBERS = NumericalError("no way leads there", hint="r2s2r plan")
DISK = ArtifactError("the disk is full", hint="df -h")


@pytest.fixture
def place(project: Path) -> Iteration:
    """The first iteration, empty."""
    found = Project.find(project).iteration(1, create=True)
    found.path.mkdir(parents=True)
    return found


def failed(path: Path, error: BaseException, *, key: str = KEY) -> BaseException:
    """What comes out of work that keeps something and then ends with an error."""
    checkpoint = CheckpointFile(path, KEY, command=("plan",))
    CheckpointFile(path, key, command=("plan",)).save({"cost": 1.0})
    with pytest.raises(type(error)) as caught, resumable(checkpoint, f"iterations/001/{path.name}", ("plan",)):
        raise error
    return caught.value


@pytest.mark.parametrize("error", [NUMBERS, KeyError("a bug")])
def test_status_does_not_offer_to_go_on(place: Iteration, project: Path, error: Exception) -> None:
    """Numbers that went wrong, and a bug: the same again would end the same way."""
    failed(checkpoint_of(place.artifact("plan")), error)
    found = survey(Project.find(project))
    assert found.artifacts == () and "--resume" not in found.next


def test_of_a_bug_nothing_is_lost(place: Iteration) -> None:
    """What was computed has another name, which the traceback says, until the artifact stands."""
    path = checkpoint_of(place.artifact("plan"))
    caught = failed(path, KeyError("a bug"))
    assert caught.__notes__ == ["what was fitted so far is kept as iterations/001/40-plan.partial.failed"]
    assert failed_of(path).exists()
    CheckpointFile(path, KEY).clear()
    assert list(place.path.iterdir()) == []


@pytest.mark.parametrize("error", [DISK, OSError("no disk"), MemoryError()])
def test_what_the_machine_refused_goes_on(place: Iteration, project: Path, error: Exception) -> None:
    """With room it need not fail again."""
    failed(checkpoint_of(place.artifact("plan")), error)
    assert survey(Project.find(project)).next == HINT


def test_what_another_request_left_stays(place: Iteration, project: Path) -> None:
    """It was interrupted, and this work has not replaced it."""
    failed(checkpoint_of(place.artifact("plan")), NUMBERS, key=OTHER)
    assert survey(Project.find(project)).next == HINT


def test_of_arrays_as_well(place: Iteration) -> None:
    """The checkpoint of a diagnosis."""
    checkpoint = ArrayCheckpoint(checkpoint_of(place.artifact("diagnosis")), KEY, command=("diagnose",))
    checkpoint.keep(b"0" * 32, [np.zeros(3)])
    with pytest.raises(Interrupted), resumable(checkpoint, "there", ("diagnose",)):
        raise KeyboardInterrupt
    assert checkpoint.kept()
    with pytest.raises(NumericalError), resumable(checkpoint, "there", ("diagnose",)):
        raise NUMBERS
    assert not checkpoint.path.exists()

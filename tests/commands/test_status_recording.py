"""`status` and `record` beside a recording: one that runs is no wreck, one that was cut off is."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.commands.record_journal import Recording
from r2s2r_cli.commands.status import survey
from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.lock import writer, writing
from r2s2r_cli.store.project import Project, journal_of
from tests.commands.conftest import invoke


@pytest.fixture
def bot(project: Path) -> Project:
    """With a journal of record and one of execute in iteration 1."""
    found = Project.find(project)
    place = found.iteration(1, create=True)
    place.path.mkdir(parents=True)
    for executed in (False, True):
        journal_of(place.artifact("recording", executed=executed)).write_bytes(b"rows")
    return found


def test_a_journal_that_nobody_writes_was_cut_off(bot: Project) -> None:
    """And the way out is recover."""
    assert writer(bot.root) is None
    found = survey(bot)
    assert [(one.stage, one.state) for one in found.artifacts] == [("record", "unsealed"), ("execute", "unsealed")]
    assert found.next.startswith("r2s2r recover ")


def test_a_journal_that_is_written_is_a_running_recording(bot: Project) -> None:
    """Nothing is to be recovered from under its writer, and nobody else may begin."""
    with writing(bot.root, "record"):
        assert "r2s2r record" in str(writer(bot.root))
        found = survey(bot)
        with pytest.raises(UsageError, match="running"):
            Recording(bot, bot.iteration(1), {}, {}, None).require_room(force=False)
    assert {one.state for one in found.artifacts} == {"recording"}
    assert not found.next.startswith("r2s2r recover")
    with pytest.raises(UsageError, match="cut off"):
        Recording(bot, bot.iteration(1), {}, {}, None).require_room(force=False)


def test_a_dry_run_leaves_the_port_of_a_running_recording_alone(bot: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    """It shows its plan and ends with exit code 0; opening the port could stop the robot of somebody else."""

    def opened(*given: object, **how: object) -> None:
        raise AssertionError("the port was opened")

    monkeypatch.setattr("r2s2r_cli.hardware.open_link.open_link", opened)
    with writing(bot.root, "record"):
        shown = invoke("record", "--random", "2", "--port", "/dev/ttyUSB0", "--dry-run")
    assert shown.exit_code == 0, shown.stderr
    assert "random-0" in shown.stdout
    assert "the sensors are not looked at" in shown.stderr and "a recording is running" in shown.stderr

"""How `record` ends where something goes wrong at its very end: the disk, the terminal, whoever reads its output."""

from __future__ import annotations

import contextlib
import os
import pty
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from r2s2r_cli import console
from r2s2r_cli.commands import record_run_pictures
from r2s2r_cli.commands.record_journal import Recording
from r2s2r_cli.commands.record_live import Live, shown, stop_key
from r2s2r_cli.console import Console, PipeClosed
from r2s2r_cli.devices.link import LinkError, Sample
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.project import journal_of
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import invoke
from tests.commands.test_record import ASK, RECORDING, Maker, link, robot_project

__all__ = ["link", "robot_project"]  # fixtures


def full() -> ArtifactError:
    """A new one, as below."""
    return ArtifactError("the disk is full", where="its disk", hint="df -h .")


def stopping(error: BaseException | None) -> Callable[[int, Sample], Sample]:
    """What raises this at the 40th sample; None: nothing does."""

    def on_read(number: int, sample: Sample) -> Sample:
        if number == 40 and error is not None:
            raise error
        return sample

    return on_read


def dead_link() -> LinkError:
    """A new one: what ends a recording gets more words on its way."""
    return LinkError("the port is gone", where="fake", expected="a robot", received="EOF", hint="r2s2r doctor ports")


@pytest.mark.parametrize(
    ("sealing", "ended", "code"),
    [
        (full(), None, 4),
        (KeyboardInterrupt(), None, 130),
        (full(), KeyboardInterrupt(), 130),
        (full(), dead_link(), 5),
    ],
)
def test_a_recording_that_is_not_sealed_is_no_success(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch,
    sealing: BaseException, ended: BaseException | None, code: int,
) -> None:  # fmt: skip
    """No room for the artifact, or a Ctrl-C while it is written: the exit code says so, the journal is named with what
    seals it, and nobody hears that nothing was recorded."""

    def refuse(*_: Any) -> NoReturn:
        raise sealing

    link(on_read=stopping(ended))
    with monkeypatch.context() as patch:
        patch.setattr(Recording, "seal", refuse)
        result = invoke(*ASK, "--no-draw")
    journal = journal_of(robot_project / RECORDING)
    assert result.exit_code == code, result.stderr
    assert f"r2s2r recover {journal}" in result.stderr and "nothing was recorded" not in result.stderr
    assert invoke("recover", str(journal)).exit_code == 0
    assert read_artifact(robot_project / RECORDING, "recording")[1].runs() == ["random-0"]


@pytest.mark.parametrize(
    ("drawing", "ended", "code"),
    [(full(), None, 4), (KeyboardInterrupt(), None, 130), (full(), KeyboardInterrupt(), 130), (full(), dead_link(), 5)],
)
def test_pictures_that_cannot_be_drawn_hide_nothing(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch,
    drawing: BaseException, ended: BaseException | None, code: int,
) -> None:  # fmt: skip
    """The recording is sealed before: it is said so, and what ended it early counts more."""

    def refuse(*_: Any) -> NoReturn:
        raise drawing

    link(on_read=stopping(ended))
    monkeypatch.setattr(record_run_pictures, "draw_recorded", refuse)
    result = invoke(*ASK)
    assert result.exit_code == code and "the recording is sealed" in result.stderr, result.stderr
    assert ("the port is gone" in result.stderr) == isinstance(ended, LinkError)
    assert read_artifact(robot_project / RECORDING, "recording")[1].runs() == ["random-0"]


@pytest.mark.parametrize(("ended", "code"), [(dead_link(), 5), (KeyboardInterrupt(), 130), (None, 0)])
def test_what_ended_it_is_told_though_nobody_reads_the_table(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch, ended: BaseException | None, code: int
) -> None:
    """`record | head`: the reader is gone, and a robot that failed must not look like one that did not."""

    def gone(_: str) -> NoReturn:
        raise PipeClosed

    link(on_read=stopping(ended))
    monkeypatch.setattr(console, "out", gone)
    assert invoke(*ASK, "--no-draw").exit_code == code
    assert (robot_project / RECORDING).exists()


def test_a_closed_terminal_spoils_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the window is closed in mid-run neither the picture, nor the key, nor a word raises anything of its own:
    what was recorded would not be sealed."""
    ours, theirs = pty.openpty()
    pressed: list[str] = []
    ended = False
    with (
        os.fdopen(theirs, "rb", buffering=0) as keys,
        contextlib.suppress(OSError),  # of what the screen still holds
        os.fdopen(os.dup(theirs), "w") as screen,
        monkeypatch.context() as patch,
    ):
        patch.setattr("sys.stderr", screen)
        with stop_key(lambda: pressed.append("space"), stream=keys), shown(Live([4]), Console()):
            os.close(ours)
        Console().warn("nobody hears this")
        ended = True
    assert ended and pressed == []

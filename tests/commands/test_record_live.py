"""What a person sees while the robot moves, and the key that stops it."""

from __future__ import annotations

import os
import pty
import termios
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.commands import record_live
from r2s2r_cli.commands.record_live import Live, shown, stop_key
from r2s2r_cli.console import Console
from r2s2r_cli.devices.link import LinkStatistics
from r2s2r_cli.stages.record import Now
from tests.support.desk import wait_until


def now(run: str, target: int, *, t: float = 3.0) -> Now:
    """A run of four targets, two cables, one of them there."""
    return Now(
        run=run, t=t, target=target, targets=4, length=np.array([0.15, np.nan]), position=np.array([0.55, np.nan]),
        aim=np.array([0.5, 1.0]), done=np.array([True, False]), rate=49.8,
        link=LinkStatistics(received=150, lost=2, corrupt=1, latency_median=0.0012), frames=90, frames_lost=3,
    )  # fmt: skip


def test_it_shows_progress_lengths_and_health(monkeypatch: pytest.MonkeyPatch) -> None:
    """Target and share of all, each cable with its length, what the link lost, what the camera lost, and the key."""
    live = Live([4, 4])
    assert live.lines() == ["waiting for the first sample"]
    live.watch(now("a-1", 3))
    first, second, *cables = live.lines()
    assert "run a-1: target 3 of 4" in first and "2 of 8 in all" in first and "s left" in first
    assert "49.8 Hz, 150 samples, lost 2, corrupt 1, 1.2 ms, camera 90 frames, 3 lost" in second
    assert "150.0 mm" in cables[0] and "done" in cables[0] and "nan" in cables[1]
    assert len(cables) == 2  # no terminal here, and so no key that anybody could press
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    assert live.lines() == [first, second, *cables, "space: emergency stop"]


def test_runs_before_count_in_the_whole() -> None:
    """The second run begins where the first ended."""
    live = Live([4, 4])
    live.watch(now("a-1", 4))
    live.watch(now("a-2", 2))
    assert "5 of 8 in all" in live.lines()[0]


def test_an_unknown_loss_is_not_zero() -> None:
    """A protocol without numbers: `lost ?`."""
    live = Live([4])
    live.watch(Now(**{**vars(now("a", 1)), "link": LinkStatistics(received=5)}))
    assert "lost ?" in live.lines()[1]


def test_without_a_terminal_a_line_now_and_then_says_how_far_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log of minutes without a word looks like one that hangs; with --quiet it is silent all the same."""
    monkeypatch.setattr(record_live, "LINE_S", 0.01)
    monkeypatch.delenv("R2S2R_NO_PROGRESS", raising=False)
    said: list[str] = []
    monkeypatch.setattr(Console, "say", lambda self, text: said.append(text))
    live = Live([4, 4])
    live.watch(now("a-1", 3))
    with shown(live, Console()):
        wait_until(lambda: len(said) > 1, 5.0)
    assert all(line.startswith("run a-1: target 3 of 4, 3.0 s; 2 of 8 in all") for line in said)
    said.clear()
    with shown(live, Console(quiet=True)):
        threading.Event().wait(0.1)
    assert said == [] and capsys.readouterr().err == ""


def test_the_space_bar_stops_and_no_other_key_does() -> None:
    """On a terminal of its own: other keys do nothing, space halts at once; afterwards the terminal is as before."""
    ours, theirs = pty.openpty()
    pressed = threading.Event()
    before = termios.tcgetattr(theirs)
    with os.fdopen(theirs, "rb", buffering=0, closefd=False) as stream:
        with stop_key(pressed.set, stream=stream):
            os.write(ours, b"xq\n")
            assert not pressed.wait(0.2)
            os.write(ours, b" ")
            wait_until(pressed.is_set, 5.0)
        assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)

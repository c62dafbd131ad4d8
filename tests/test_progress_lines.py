"""Progress where stderr is a file or pipe."""

from __future__ import annotations

import pytest

from r2s2r_cli import console as module
from r2s2r_cli.console import LINE_S, NO_PROGRESS, Console


class Clock:
    """A clock that goes on as it is told."""

    now = 100.0

    def monotonic(self) -> float:
        """Seconds."""
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The clock of the console."""
    found = Clock()
    monkeypatch.setattr(module, "time", found)
    return found


def test_a_line_now_and_then_says_how_far_it_is(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    """One after LINE_S, and not at the end of a part; time left from what was done since the part was first named."""
    with Console().parts() as show:
        show("search", 40, 100, "")
        clock.now += LINE_S + 1
        show("search", 60, 100, "cost 3")
        show("search", 61, 100, "")
        clock.now += LINE_S + 1
        show("search", 100, 100, "")
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == "search: 60 of 100 after 31 s, about 62 s left of this part, cost 3\n"


def test_the_time_left_of_one_part_alone_is_that_of_all(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    """Where nothing else can follow it is not called that of a part."""
    with Console().progress("sets", 4) as advance:
        clock.now += LINE_S + 1
        advance(1)
    assert capsys.readouterr().err == "sets: 1 of 4 after 31 s, about 93 s left\n"


@pytest.mark.parametrize("silenced", ["quiet", "environment"])
def test_it_is_silent_where_that_was_asked_for(
    silenced: str, clock: Clock, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --quiet, or R2S2R_NO_PROGRESS."""
    if silenced == "environment":
        monkeypatch.setenv(NO_PROGRESS, "1")
    with Console(quiet=silenced == "quiet").parts() as show:
        show("search", 0, 100, "")
        clock.now += 10 * LINE_S
        show("search", 60, 100, "")
    assert capsys.readouterr().err == ""

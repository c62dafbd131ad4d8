"""`identify` while it runs: an interrupt, and the time of its parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.commands.identify_inputs import Asked
from r2s2r_cli.commands.identify_run import Clock
from tests.commands.conftest import invoke


def test_an_interrupt_is_one_statement(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a checkpoint of this request: what is kept, and the command that goes on; with that of another, which stays:
    whose it is; without one: run it again."""
    saves, kept = [True, False, False], "iterations/001/30-identify.partial"

    def stopped(asked: Asked, settings: Any, checkpoint: Any, console: Any) -> None:
        if saves.pop(0):
            checkpoint.save({"round": 1})
        raise KeyboardInterrupt

    monkeypatch.setattr("r2s2r_cli.commands.identify_run.compute", stopped)
    first = "r2s2r identify --train sample:1-2 --seed 4 --no-draw"
    result = invoke(*first.split()[1:])
    assert result.exit_code == 130
    assert result.stderr.splitlines() == [
        f"interrupted: what was fitted so far is kept in {kept}, nothing else was written",
        f"hint: {first} --resume",
    ]
    result = invoke("identify", "--train", "sample:1-3")  # another request: that checkpoint is not its own
    assert result.stderr.splitlines() == [
        f"interrupted: nothing was fitted yet; {kept} is still what another request left: {first}",
        "hint: r2s2r identify --train sample:1-3",
    ]
    assert result.exit_code == 130
    (estimated / kept).unlink()
    result = invoke("identify", "--train", "sample:1-3")
    assert result.stderr == "interrupted: nothing is half-written; run the command again\n"
    assert result.exit_code == 130


def test_time_is_booked_to_the_part_that_was_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """What came before the first part counts to it; the parts add up to the whole."""
    now = iter([0.0, 2.0, 5.0, 6.0, 9.0, 9.0])
    monkeypatch.setattr("time.monotonic", lambda: next(now))
    clock = Clock()
    for part in ("fit", "fit", "profiles", "fit"):
        clock.enter(part)
    assert clock.seconds() == {"fit": 8.0, "profiles": 1.0}
    assert clock.total() == 9.0

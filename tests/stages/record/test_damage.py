"""A damaged reading drives no winch the wrong way, and what was received is written whatever comes afterwards."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from r2s2r_cli.devices.link import STOPS, Sample
from r2s2r_cli.stages.record.still import Still
from r2s2r_cli.stages.record.writer import Writer
from tests.support.fake_robot import FakeLink, calibrated
from tests.support.sessions import policy, recorded

HIT = 80
"""Sample in which a number is damaged."""


@pytest.mark.parametrize("farads", [0.2e-13, 1.15e-9], ids=["digits lost", "digits too many"])
@pytest.mark.parametrize("target", [0.0, 1.0])
def test_one_damaged_reading_has_no_lasting_effect(farads: float, target: float) -> None:
    """Metres of cable are no length: the cable rests for that tick, nothing is summed up and nothing is done."""
    robot = calibrated()
    damaged = [sensor.cable for sensor in robot.sensors].index(robot.actuated[0])

    def on_read(number: int, sample: Sample) -> Sample:
        if number != HIT:
            return sample
        capacitance = sample.capacitance.copy()
        capacitance[damaged] = farads
        return replace(sample, capacitance=capacitance)

    both = []
    for link in (FakeLink(robot), FakeLink(robot, on_read=on_read)):
        session, rows = recorded(link, policy(robot, 1.0 - target, target, 0.5), rest=0.0)
        assert not session.runs[0].timed_out
        both.append([rows.column("runs/gait/commands", name)[:, 0] for name in ("control", "done")])
    (true, _), (control, done) = both
    at = HIT - 1
    assert control[at] == 0.0 and not done[at] and abs(true[at]) > 0.1
    assert (control[at + 1 : at + 10] * true[at] > 0).all(), "a tick later, and the same way"
    assert len(control) - len(true) in (0, 1, 2)


def test_what_was_received_is_written_though_somebody_presses() -> None:
    """One Ctrl-C while the rows of a run that has ended wait for the disk: all of them arrive, then it is heard."""
    rows: list[Mapping[str, Any]] = []

    def slow(stream: str, row: Mapping[str, Any]) -> None:
        del stream
        time.sleep(0.005)
        rows.append(row)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), Writer(slow) as writer:
            for number in range(80):
                writer.put("runs/a/commands", {"t": float(number)})
            threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    finally:
        signal.signal(signal.SIGINT, before)
    assert [row["t"] for row in rows] == list(range(80))


@pytest.mark.parametrize(("watchdog", "lock_step", "again"), [(None, False, True), (0.25, False, False),
                                                              (None, True, False)])  # fmt: skip
def test_a_robot_without_a_watchdog_is_told_again_and_again(
    watchdog: float | None, lock_step: bool, again: bool
) -> None:
    """While the disk stands still, and a few times where it does not; one that stops by itself is told once."""
    link = FakeLink(calibrated())
    link.facts = replace(link.facts, watchdog=watchdog, lock_step=lock_step)
    with Still(link) as still:
        still.begin()
        still.begin()
    at_once = link.stops
    assert at_once >= 2 + STOPS if again else at_once == 2
    with Still(link) as still:
        still.begin()
        time.sleep(0.5)
    assert link.stops - at_once > 2 * STOPS if again else link.stops - at_once == 1

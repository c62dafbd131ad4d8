"""A host that is slower than the robot, on a clock of its own: found out before what it drives on is old."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from r2s2r_cli.devices.link import SafetyStop, Sample
from r2s2r_cli.hardware.guard import GuardedLink
from r2s2r_cli.hardware.pace import UNEMPTIED, Pace
from r2s2r_cli.hardware.watch import STALE
from tests.hardware.test_guard import TICK, Clockwork
from tests.support.wire_robot import calibrated


def message(board: int) -> Sample:
    """From one of three boards."""
    fresh = np.arange(9) // 3 == board
    return Sample(t_host=0.0, board=board, t_board=0.0, due=board == 0, capacitance=np.zeros(9), t_sensor=np.zeros(9),
                  fresh=fresh, encoder=np.zeros(6))  # fmt: skip


def drive(seconds: float, cost: float, *pauses: tuple[float, float]) -> tuple[str, float, float]:
    """Three boards send every TICK, a message costs the host `cost` [s], and it stands still at some times for so long
    [s]: why it is stopped, when, and how old the oldest message was that it had driven on [s]."""
    pace, queue, now, sent, oldest = Pace(TICK), deque[tuple[float, int]](), 0.0, 0, 0.0
    left = list(pauses)
    while now < seconds:
        while sent * TICK / 3 <= now:
            queue.append((sent * TICK / 3, sent % 3))
            sent += 1
        reason = pace.look(now, waits=bool(queue))
        if reason:
            return reason, now, oldest
        if left and now >= left[0][0]:
            now += left.pop(0)[1]
            continue
        if not queue:
            now += 0.001
            continue
        at, board = queue.popleft()
        oldest = max(oldest, now - at)
        pace.sample(message(board))
        now += cost
    return "", now, oldest


@pytest.mark.parametrize("cost", [0.007, 0.009, 0.02, 0.05, 0.1])
def test_a_slow_host_is_stopped_before_it_drives_on_old_readings(cost: float) -> None:
    """Of a message every 6.7 ms: whatever one costs it, none of them is older than the duty of stale sensors allows, by
    more than a message or two."""
    reason, stopped, oldest = drive(20.0, cost)
    assert reason.startswith("this host cannot keep up") and stopped < 1.2 * UNEMPTIED + 2 * cost
    assert oldest < STALE + 2 * cost


@pytest.mark.parametrize("cost", [0.001, 0.003, 0.005, 0.0066])
def test_a_host_that_is_fast_enough_is_left_alone(cost: float) -> None:
    """However near to its limit."""
    assert drive(20.0, cost)[0] == ""


def test_a_pause_is_worked_off() -> None:
    """Half a second in which the machine did something else, again and again, with time between them to catch up; and
    small ones without."""
    assert drive(20.0, 0.002, *((float(k), 0.5) for k in range(1, 18, 2)))[0] == ""
    assert drive(20.0, 0.002, (1.0, 0.5), (1.55, 0.06), (1.7, 0.06))[0] == ""
    assert drive(20.0, 0.006, (1.0, 0.9))[0] != ""  # it would need 8 s


def test_the_guard_stops_the_robot_of_a_slow_host() -> None:
    """Five messages come while one is read: the motors are told to stop, and nothing moves them later."""
    inner = Clockwork()
    with GuardedLink(inner, calibrated()) as link:
        with pytest.raises(SafetyStop, match="this host cannot keep up"):
            while link.now() < 20.0:
                inner.k += 5
                inner.waiting += [inner.next() for _ in range(5)]
                link.read(TICK)
                link.command(np.ones(6))
        assert link.now() < 1.0 and inner.said[-1][1] == "stop"
    link.inner.waiting.clear()
    with pytest.raises(SafetyStop):
        link.command(np.ones(6))


def test_a_new_run_begins_without_a_backlog() -> None:
    """What had waited is thrown away by `restart`, and the time until then is forgotten."""
    inner = Clockwork()
    with GuardedLink(inner, calibrated()) as link:
        for _ in range(3):
            inner.k += 7
            inner.waiting += [inner.next() for _ in range(5)]
            link.read(TICK)
            link.restart()
        assert not inner.waiting

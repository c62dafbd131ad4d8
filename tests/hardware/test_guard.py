"""The duties of the host, on a robot in lock-step memory: each stops the motors by itself, and is latched."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Callable

import numpy as np
import pytest

from r2s2r_cli.devices.lengths import NOT_INITIALISED
from r2s2r_cli.devices.link import LinkError, LinkFacts, LinkState, LinkStatistics, RobotLink, SafetyStop, Sample
from r2s2r_cli.errors import ExitCode
from r2s2r_cli.hardware.guard import GuardedLink
from r2s2r_cli.hardware.signals import ENDING, interrupting_signals
from tests.support.wire_robot import OFFSET, SLOPE, calibrated

TICK = 0.02


class Clockwork:
    """A link whose time goes on by a tick at every read that waits; wrong: what becomes of the values of tick k."""

    facts = LinkFacts(port="/dev/fake", protocol="checked")
    state = LinkState.RUNNING
    statistics = LinkStatistics()

    def __init__(self, wrong: Callable[[int, np.ndarray], np.ndarray | None] = lambda k, c: c) -> None:
        self.k = 0
        self.wrong = wrong
        self.said: list[tuple[float, object]] = []
        self.waiting: list[Sample] = []
        self.draw = np.random.default_rng(0)
        self.length = np.full(9, 0.15)
        self.t_sensor = np.full(9, np.nan)
        self.capacitance = np.full(9, np.nan)

    def now(self) -> float:
        return self.k * TICK

    def read(self, timeout: float) -> Sample | None:
        if self.waiting:
            return self.waiting.pop(0)
        if timeout <= 0:
            return None
        self.k += 1
        return self.next()

    def next(self) -> Sample | None:
        """The message of this tick."""
        noisy = SLOPE * (self.length + self.draw.normal(0, 5e-4, 9)) + OFFSET
        value = self.wrong(self.k, np.round(noisy, 14))
        if value is None:
            return None
        fresh = np.isfinite(value)
        self.capacitance = np.where(fresh, value, self.capacitance)
        self.t_sensor = np.where(fresh, self.now(), self.t_sensor)
        return Sample(t_host=self.now(), board=0, t_board=math.nan, due=True, capacitance=self.capacitance,
                      t_sensor=self.t_sensor, fresh=fresh, encoder=np.full(6, np.nan))  # fmt: skip

    def command(self, speed: np.ndarray) -> None:
        self.said.append((self.now(), speed))

    def stop(self) -> None:
        self.said.append((self.now(), "stop"))

    def emergency_stop(self) -> None:
        self.said.append((self.now(), "emergency"))

    def reset(self) -> None:
        self.said.append((self.now(), "reset"))

    def reconnect(self, timeout: float = 10.0) -> None:
        self.said.append((self.now(), "reconnect"))

    def __enter__(self) -> Clockwork:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def drive(link: GuardedLink, seconds: float, speed: float = 1.0) -> None:
    """A loop that always commands the same."""
    while link.now() < seconds - 1e-9:
        if link.read(TICK) is not None:
            link.command(np.full(6, speed))


def stuck(value: float) -> Callable[[int, np.ndarray], np.ndarray]:
    """Sensor 3 has this value from 1 s on."""
    return lambda k, c: np.where((np.arange(9) == 3) & (k * TICK > 1), value, c)


@pytest.mark.parametrize(
    ("wrong", "what", "after"),
    [
        (stuck(NOT_INITIALISED), "sends 0.20 pF", 0.2), (stuck(np.nan), "no good reading of cable 3", 0.2),
        (stuck(SLOPE * 0.45 + OFFSET), "cable 3 measures 450 mm", 0.04),
        (stuck(SLOPE * 0.01 + OFFSET), "cable 3 measures 10 mm", 0.04),
        (lambda k, c: None if k * TICK > 1 else c, "nothing came for", 0.2),
        (lambda k, c: np.where(np.arange(9) // 3 == 1, np.nan, c) if k * TICK > 1 else c, "cable 3, 4, 5 for 200", 0.2),
    ],
    ids=["not set up", "drop-out", "too long", "too short", "silence", "a board gone"],
)  # fmt: skip
def test_each_failure_of_sensors_stops_the_motors(
    wrong: Callable[[int, np.ndarray], np.ndarray | None], what: str, after: float
) -> None:
    """From 1 s on something is wrong: a stop is said within the time of the duty and one tick; nothing moves later."""
    inner = Clockwork(wrong)
    with pytest.raises(SafetyStop, match=what) as caught, GuardedLink(inner, calibrated()) as link:
        drive(link, 5.0)
    assert caught.value.exit_code == ExitCode.HARDWARE and "/dev/fake" in caught.value.where and caught.value.hint
    first = next(t for t, said in inner.said if isinstance(said, str) and said == "stop")
    assert 1.0 < first <= 1.0 + after + 2 * TICK + 1e-9
    assert all(isinstance(said, str) for t, said in inner.said if t >= first)


@pytest.mark.parametrize("begins", [-1.0, 1.0], ids=["before it is driven", "in motion"])
def test_a_frozen_sensor_holds_the_motors_at_once_and_stops_them_for_good(begins: float) -> None:
    """Nothing is driven for longer than 200 ms on a value that does not change; after 0.8 s of that it is a stop."""
    inner = Clockwork(lambda k, c: np.where((np.arange(9) == 3) & (k * TICK > begins), SLOPE * 0.15 + OFFSET, c))
    with pytest.raises(SafetyStop, match="frozen sensor: that of cable 3"), GuardedLink(inner, calibrated()) as link:
        drive(link, 0.5, 0.0)
        drive(link, 5.0)
    first = max(begins, 0.5)
    moved = [t for t, said in inner.said if not isinstance(said, str) and np.any(said)]
    assert moved[0] == pytest.approx(0.5, abs=1.5 * TICK) and moved[-1] <= first + 0.2 + 1e-9
    assert first + 0.8 < inner.now() <= first + 0.9


def test_a_cable_that_stands_still_is_no_frozen_sensor() -> None:
    """Driven for 200 s in vain, read in the steps of a 10-bit converter with noise of half a step: a run of equal
    values long enough to hold the motors is rare, ends with the next value, and is told; none stops the robot."""
    step = SLOPE * 0.001
    inner = Clockwork(lambda k, c: np.round(c / step) * step)
    told = set()
    with GuardedLink(inner, calibrated()) as link:
        while link.now() < 200.0:
            sample = link.read(TICK)
            assert sample is not None
            told.add(sample.doubt)
            link.command(np.ones(6))
        assert not any(isinstance(said, str) for _, said in inner.said)  # held is not stopped: the run goes on
    held = [t for t, said in inner.said if not isinstance(said, str) and not np.any(said)]
    assert 0 < len(held) * TICK < 0.05 * 200.0  # six cables at once, each in the middle of a step
    assert "" in told and all(text in told for text in (f"the sensor of cable {i} may be frozen" for i in range(6)))


def test_a_sensor_without_noise_that_moves_is_not_doubted() -> None:
    """A value that changes by a step of the converter every 0.1 s, as at a sixth of the speed, holds nothing."""
    inner = Clockwork(lambda k, c: SLOPE * (0.15 + 0.001 * np.full(9, k // 5 % 40)) + OFFSET)
    with GuardedLink(inner, calibrated()) as link:
        drive(link, 5.0)
    assert all(np.all(said == 1) for _, said in inner.said if not isinstance(said, str))


def test_a_healthy_robot_is_left_alone() -> None:
    """20 s with noise of 0.5 mm, a short drop-out, single wild values, winches that pull in vain: no reason to end."""

    def wrong(k: int, c: np.ndarray) -> np.ndarray | None:
        if 100 <= k < 108:
            return None
        return np.where((np.arange(9) == 2) & (k % 50 == 3), SLOPE * 0.9 + OFFSET, c)

    with GuardedLink(Clockwork(wrong), calibrated(), time_limit=30.0) as link:
        assert isinstance(link, RobotLink)
        drive(link, 20.0)


def test_a_passive_sensor_may_fail() -> None:
    """Cables without a motor are not driven: their sensors stop nothing."""
    link = GuardedLink(Clockwork(lambda k, c: np.where(np.arange(9) == 7, np.nan, c)), calibrated())
    with link:
        drive(link, 3.0)


def test_the_time_limit_ends_a_run_and_a_new_run_has_its_own() -> None:
    """As long as it was given, not longer; `restart` begins anew."""
    link = GuardedLink(Clockwork(), calibrated(), time_limit=2.0)
    with link:
        drive(link, 1.9)
        link.restart(time_limit=3.0)
        drive(link, 4.8)
        with pytest.raises(SafetyStop, match="time limit"):
            drive(link, 6.0)
        assert link.now() == pytest.approx(1.9 + 3.0, abs=2.5 * TICK)


def test_a_stop_by_the_host_is_latched_until_reset() -> None:
    """Everything is refused with the first reason, until `reset`; then it goes on."""
    inner = Clockwork(stuck(np.nan))
    with GuardedLink(inner, calibrated()) as link:
        with pytest.raises(SafetyStop):
            drive(link, 5.0)
        for call in (lambda: link.read(0.0), lambda: link.command(np.zeros(6))):
            with pytest.raises(SafetyStop, match="no good reading"):
                call()
        inner.wrong = lambda k, c: c
        link.reset()
        drive(link, link.now() + 1.0)
        link.emergency_stop()
        with pytest.raises(SafetyStop, match="emergency stop"):
            link.command(np.zeros(6))
    assert [said for _, said in inner.said if isinstance(said, str)] == ["stop", "reset", "emergency", "stop"]


def test_a_dry_run_moves_nothing() -> None:
    """Every command that reaches the robot is zero, and a frozen value is no wonder then; nonsense is still refused."""
    inner = Clockwork(lambda k, c: np.full(9, SLOPE * 0.15 + OFFSET))
    with GuardedLink(inner, calibrated(), dry_run=True) as link:
        drive(link, 3.0)
        link.command(np.full(6, np.nan))
    speeds = np.array([said for _, said in inner.said if not isinstance(said, str)])
    assert len(speeds) > 100 and (speeds[:-1] == 0).all() and np.isnan(speeds[-1]).all()


@pytest.mark.parametrize("number", [*ENDING, signal.SIGINT], ids=lambda number: number.name)
def test_polite_kills_leave_the_context(number: signal.Signals) -> None:
    """Each of them, Ctrl-Z and Ctrl-backslash too, becomes an exception in the run; the motors are told to stop;
    handlers come back."""
    inner, before = Clockwork(), signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), interrupting_signals(), GuardedLink(inner, calibrated()) as link:
        link.command(np.ones(6))
        os.kill(os.getpid(), number)
        drive(link, 5.0)
    assert inner.said[-1][1] == "stop" and signal.getsignal(number) == before


@pytest.mark.parametrize("first", [signal.SIGTERM, signal.SIGINT])
def test_a_stop_that_comes_twice_interrupts_once(first: signal.Signals) -> None:
    """A terminal, `timeout` and `r2s2r run` all pass a signal on: what ends the run is not interrupted by the rest."""
    with interrupting_signals() as signals:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), first)
        for number in ENDING:
            os.kill(os.getpid(), number)
        signals.standing()
        os.kill(os.getpid(), signal.SIGTERM)


def test_a_link_that_dies_while_it_is_entered_is_closed() -> None:
    """The port is open then, and the robot there: it is told to stop."""

    class Dying(Clockwork):
        def read(self, timeout: float) -> Sample | None:
            raise LinkError("gone", where="fake", hint="plug it in")

    inner = Dying()
    with pytest.raises(LinkError), GuardedLink(inner, calibrated()):
        pytest.fail("it was entered")
    assert inner.said == [(0.0, "stop")]


def test_files_are_written_to_their_end() -> None:
    """A signal once the robot stands waits for the end of the context: no exception falls into the sealing."""
    sealed = False
    with pytest.raises(KeyboardInterrupt), interrupting_signals() as signals:
        signals.standing()
        os.kill(os.getpid(), signal.SIGTERM)
        sealed = True
    assert sealed


def test_a_host_that_was_held_up_is_not_a_robot_that_fell_silent() -> None:
    """0.3 s in which nothing was read: the boards' messages wait one behind the other, and all are read before judging.

    A board that is not among them is stale then; and one that only ever sends old messages is found out in the end.
    """

    def message(link: Clockwork, board: int) -> Sample:
        fresh = np.arange(9) // 3 == board
        link.t_sensor = np.where(fresh, link.now(), link.t_sensor)
        return Sample(t_host=link.now(), board=board, t_board=math.nan, due=board == 0, capacitance=link.capacitance,
                      t_sensor=link.t_sensor, fresh=fresh, encoder=np.full(6, np.nan))  # fmt: skip

    for boards, healthy in (((0, 1, 2), True), ((0, 1, 0), True), ((0, 0, 2), False)):
        inner = Clockwork()
        with GuardedLink(inner, calibrated()) as link:
            drive(link, 0.5, 0.0)
            inner.k += 15
            inner.waiting = [message(inner, board) for board in boards]
            if healthy:
                link.command(np.zeros(6))
                for _ in boards:
                    link.read(TICK)
                link.command(np.zeros(6))
            else:
                with pytest.raises(SafetyStop, match=r"cable 3, 4, 5 .* any board .*; this machine itself"):
                    drive(link, 2.0, 0.0)
    inner = Clockwork()
    with GuardedLink(inner, calibrated()) as link, pytest.raises(SafetyStop, match="no good reading"):
        drive(link, 0.5, 0.0)
        for _ in range(200):
            inner.k += 1
            inner.waiting = [message(inner, 0) for _ in range(3)]
            link.read(TICK)

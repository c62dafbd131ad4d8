"""A robot on a port: closed -> connecting -> handshake -> running -> lost -> connecting ... -> closed.

`Link` is a `RobotLink` for any transport and any codec. What a conversation begins with is in `handshake.py`, what is
heard in `inbox.py`, how it ends in `farewell.py`, how time goes on in lock-step in `lock_step.py`; the duties of the
host beyond the port (stale sensors, limits) in `guard.py`.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from r2s2r_cli.devices.link import EMERGENCY, LinkError, LinkFacts, LinkState, LinkStatistics, SafetyStop, Sample
from r2s2r_cli.hardware import farewell, handshake
from r2s2r_cli.hardware.codec.base import Codec, Greeting, Outgoing
from r2s2r_cli.hardware.inbox import Inbox
from r2s2r_cli.hardware.lock_step import LockStepClock
from r2s2r_cli.hardware.look import look_at
from r2s2r_cli.hardware.routes import Routes
from r2s2r_cli.hardware.statistics import Tally
from r2s2r_cli.hardware.transport import Address, Transport
from r2s2r_cli.hardware.wiring import Wiring

if TYPE_CHECKING:
    from schemas.robot import Robot

_LOCK = 0.05
"""[s] for which a stop waits for a write of another thread, before it writes all the same."""
_FLOOD = 0.05
"""[s] beyond its time-out for which a read goes through lines that are no samples: behind a few of them one may wait,
but a device gone mad that sends them without end must not keep a guard from its clock."""


class Link:
    """One robot. Enter it to connect; whatever happens then, leaving it stops the motors."""

    def __init__(self, transport: Transport, codec: Codec, robot: Robot, *, handshake_timeout: float = 5.0) -> None:
        self.transport, self.codec, self.robot = transport, codec, robot
        self.handshake_timeout = handshake_timeout
        self.period = 1 / robot.pid.rate_hz
        self.greeting: Greeting | None = None
        self.lock_step: LockStepClock | None = None
        self.routes = Routes()
        self.tally = Tally(numbered=codec.numbered)
        self._wiring = Wiring.of(robot)
        self.inbox = Inbox(self, self._wiring)
        self._state = LinkState.CLOSED
        self._lock = threading.RLock()
        self._latched = ""
        self._ever = False

    # What others may ask

    @property
    def facts(self) -> LinkFacts:
        """What the handshake told; before it, what is known of the protocol."""
        return handshake.facts(self)

    @property
    def state(self) -> LinkState:
        """Where the link is in its life."""
        return self._state

    @property
    def statistics(self) -> LinkStatistics:
        """Health so far."""
        return self.tally.snapshot(self.transport.overlong, clocks=self.lock_step is None)

    def now(self) -> float:
        """Monotonic time of the host [s]; in lock-step the device's."""
        return self.lock_step.t if self.lock_step else time.monotonic()

    # Life

    def __enter__(self) -> Self:
        """Raises LinkError where nobody answers, SafetyStop where the device's emergency stop is latched."""
        self._connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop, wait for the acknowledgement where there is one, close."""
        running, self._state = self._state is LinkState.RUNNING, LinkState.CLOSED
        try:
            if running:
                farewell.say_stop(self)
        finally:
            self.stop()  # reached by a second Ctrl-C during the line above as well
            self.transport.close()

    def reconnect(self, timeout: float = 10.0) -> None:
        """Open the port again, motors stopped. Raises the last LinkError after `timeout` [s]."""
        self._persist(handshake.shake, timeout)

    def _persist(self, begin: Callable[[Link], None], timeout: float) -> None:
        """Connect, again and again for `timeout` [s]."""
        end = time.monotonic() + timeout
        while True:
            try:
                return self._connect(begin)
            except LinkError:
                if time.monotonic() >= end:
                    raise
                time.sleep(min(0.2, max(0.0, end - time.monotonic())))

    def _connect(self, begin: Callable[[Link], None] = handshake.shake) -> None:
        self._state = LinkState.CONNECTING
        self.routes, self.lock_step, self.greeting = Routes(), None, None
        self.inbox.restart()
        self.tally.restart()
        try:
            self.transport.open()
            self._state = LinkState.HANDSHAKE
            self.stop()
            begin(self)
            if self.lock_step is None and not self.facts.stops_by_itself:
                self.stop()  # now that it is known where each board is: one may still do what a host that died told it
        except BaseException as error:
            self.stop()
            self.transport.close()
            self._state = LinkState.LOST
            self._in_our_words(error)
            raise
        self._state = LinkState.RUNNING
        self.tally.reconnects += self._ever
        self._ever = True

    # The loop

    def read(self, timeout: float) -> Sample | None:
        """The next sample, in order of arrival; None where none came within `timeout` [s] of `now`.

        Raises LinkError where the port died or the device started anew, SafetyStop where it is latched.
        """
        self._refuse()
        with self._dying():
            if self.lock_step:
                return self.lock_step.read(self, timeout)
            end = time.monotonic() + timeout
            while (sample := self.inbox.next_sample()) is None:
                left = end - time.monotonic()
                message = self.transport.receive(max(0.0, left))
                if message is not None:
                    self.inbox.take(message)
                if left <= (0.0 if message is None else -_FLOOD):
                    self.tally.silent(time.monotonic())
                    break
            return sample

    def command(self, speed: np.ndarray) -> None:
        """Speeds in -1 .. 1, (actuated,), +1 reels in. Raises LinkError, SafetyStop; ValueError for other numbers."""
        duty = self._wiring.duty(speed)
        self._refuse()
        with self._dying(), self._lock:
            if not self._latched:  # by another thread, just now
                line = self.codec.command(duty)
                for place in self.routes.command(line, at_once=self.lock_step is not None):
                    self.transport.send(line.data, place)
                self.tally.asked(line.seq, time.monotonic())

    def stop(self) -> None:
        """All motors off, now. Never raises; from any thread."""
        self._say(self.codec.stop)

    def emergency_stop(self) -> None:
        """Stop and latch, here and on the device where it can. Never raises; from any thread."""
        self._latched = EMERGENCY
        self._say(self.codec.emergency)

    def reset(self) -> None:
        """Take the latch off, on a new connection. Raises LinkError where the device does not confirm it."""
        self._persist(handshake.unlatch, self.handshake_timeout)
        self._latched = ""

    def _say(self, what: Callable[[], Outgoing]) -> None:
        """A line of the codec to everybody, whatever the state of the port, and no answers until the next command."""
        locked = self._lock.acquire(timeout=_LOCK)
        try:
            self.routes.silence()
            with contextlib.suppress(Exception):  # a stop may be tried on a port that is dead or not open
                self.send(what())
        finally:
            if locked:
                self._lock.release()

    # For the parts of a conversation

    def send(self, line: Outgoing) -> None:
        """A line to every place that it must reach. Raises LinkError."""
        with self._lock:
            for place in self.routes.everywhere(line):
                self.transport.send(line.data, place)
            self.tally.asked(line.seq, time.monotonic())

    def answer(self, data: bytes, place: Address | None) -> None:
        """Bytes to the sender of a message. Raises LinkError."""
        with self._lock:
            self.transport.send(data, place)

    @property
    def latched_here(self) -> bool:
        """Whether the emergency stop was pressed on this side."""
        return self._latched == EMERGENCY

    def latched_there(self) -> None:
        """The device says that its emergency stop is latched. Raises SafetyStop."""
        self._latched = self._latched or "the device's emergency stop"
        self._refuse()

    def _refuse(self) -> None:
        if self._latched:
            raise SafetyStop(f"the robot is stopped: {self._latched}", where=self.transport.name,
                             expected="an explicit reset", received="latched",
                             hint=look_at(self.transport.name, self.codec.name, reset=True))  # fmt: skip
        if self._state is not LinkState.RUNNING:
            raise LinkError("there is no link to the robot", where=self.transport.name, expected="running",
                            received=self._state.value, hint=look_at(self.transport.name, self.codec.name))  # fmt: skip

    @contextlib.contextmanager
    def _dying(self) -> Iterator[None]:
        """A LinkError inside: stop by whatever way is left, then let it out, saying what became of the motors."""
        try:
            yield
        except LinkError as error:
            self._state = LinkState.LOST
            error.received += f"; {farewell.rescue(self)}"
            self._in_our_words(error)
            raise

    def _in_our_words(self, error: BaseException) -> None:
        """A port knows no protocol; whoever is told to look at it needs ours."""
        port = self.transport.name
        if isinstance(error, LinkError) and error.hint == look_at(port):
            error.hint = look_at(port, self.codec.name)

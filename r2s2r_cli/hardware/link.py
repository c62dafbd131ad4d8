"""A robot on a port: closed -> connecting -> handshake -> running -> lost -> connecting ... -> closed.

`Link` is a `RobotLink` for any transport and any codec. What a conversation begins with is in `handshake.py`, how time
goes on in lock-step in `lock_step.py`; the duties of the host beyond the port (stale sensors, limits) in `guard.py`.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from r2s2r_cli.devices.link import LinkError, LinkFacts, LinkState, LinkStatistics, SafetyStop, Sample
from r2s2r_cli.hardware import handshake
from r2s2r_cli.hardware.codec.base import (
    Ack,
    Beat,
    Codec,
    Corrupt,
    DeviceState,
    Event,
    Greeting,
    Outgoing,
    Reading,
    Status,
)
from r2s2r_cli.hardware.lock_step import LockStepClock
from r2s2r_cli.hardware.routes import Routes
from r2s2r_cli.hardware.statistics import Tally
from r2s2r_cli.hardware.transport import Message, Transport
from r2s2r_cli.hardware.wiring import Picture, Wiring

if TYPE_CHECKING:
    from schemas.robot import Robot

STOPS = 5
"""How often a stop is said at the end, where nobody acknowledges it."""
STOP_PAUSE = 0.02
"""[s] between them: a board reads one datagram a turn."""
RESCUE = 0.2
"""[s] for which a dead port is tried again, to say stop."""
_LOCK = 0.05
"""[s] for which a stop waits for a write of another thread, before it writes all the same."""


class Link:
    """One robot. Enter it to connect; whatever happens then, leaving it stops the motors."""

    def __init__(self, transport: Transport, codec: Codec, robot: Robot, *, handshake_timeout: float = 5.0) -> None:
        self.transport, self.codec, self.robot = transport, codec, robot
        self.handshake_timeout = handshake_timeout
        self.period = 1 / robot.pid.rate_hz
        self.greeting: Greeting | None = None
        self.lock_step: LockStepClock | None = None
        self.routes = Routes()
        self._wiring = Wiring.of(robot)
        self._picture = Picture(self._wiring, self.period)
        self._tally = Tally(numbered=codec.numbered)
        self._state = LinkState.CLOSED
        self._samples: deque[Sample] = deque()
        self._lock = threading.RLock()
        self._latched = ""
        self._held = False
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
        return self._tally.snapshot(self.transport.overlong, clocks=self.lock_step is None)

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
                self._last_words()
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
        self._samples.clear()
        self.routes, self.lock_step, self.greeting, self._held = Routes(), None, None, False
        self._picture.restart()
        self._tally.restart()
        try:
            self.transport.open()
            self._state = LinkState.HANDSHAKE
            self.stop()
            begin(self)
        except BaseException:
            self.stop()
            self.transport.close()
            self._state = LinkState.LOST
            raise
        self._state = LinkState.RUNNING
        self._tally.reconnects += self._ever
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
            while not self._samples:
                left = end - time.monotonic()
                message = self.transport.receive(max(0.0, left))
                if message is not None:
                    self.take(message)
                elif left <= 0:
                    self._tally.silent(time.monotonic())
                    return None
            return self._samples.popleft()

    def command(self, speed: np.ndarray) -> None:
        """Speeds in -1 .. 1, (actuated,), +1 reels in. Raises LinkError, SafetyStop; ValueError for other numbers."""
        duty = self._wiring.duty(speed)
        self._refuse()
        with self._dying(), self._lock:
            if not self._latched:  # by another thread, just now
                line = self.codec.command(duty)
                for place in self.routes.command(line, at_once=self.lock_step is not None):
                    self.transport.send(line.data, place)
                self._tally.asked(line.seq, time.monotonic())

    def stop(self) -> None:
        """All motors off, now. Never raises; from any thread."""
        self._say(self.codec.stop)

    def emergency_stop(self) -> None:
        """Stop and latch, here and on the device where it can. Never raises; from any thread."""
        self._latched = "emergency stop"
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

    def send(self, line: Outgoing) -> None:
        """A line to every place that it must reach. Raises LinkError."""
        with self._lock:
            for place in self.routes.everywhere(line):
                self.transport.send(line.data, place)
            self._tally.asked(line.seq, time.monotonic())

    # What comes in

    def take(self, message: Message, *, t: float | None = None) -> Event | None:
        """Count a message, answer it where that is due, keep its sample. t: its time where `now` is not the host's.

        Gives the event, or None where it is to be ignored (repeated, late). Raises LinkError, SafetyStop.
        """
        event = self.codec.decode(message.line)
        if isinstance(event, Corrupt):
            self._tally.corrupt += 1
            return event
        board = event.board if isinstance(event, Reading) and event.measures else None
        answer = self.routes.heard(message.source, board)
        if answer is not None:
            with self._lock:
                self.transport.send(answer, message.source)
        self._tally.heard(message.t)
        numbers = self._tally.numbers
        if numbers and event.seq is not None:
            if isinstance(event, Greeting):
                numbers.greeted(event.seq)
            elif not numbers.new(event.seq, event.board if isinstance(event, Reading) else None):
                return None
        self._tally.received += 1
        match event:
            case Reading():
                self._note(event.state)
                if not self.lock_step:
                    self._tally.stamped(event.board, message.t, event.t_board)
                self._samples.append(self._picture.add(event, message.t if t is None else t))
            case Ack():
                self._tally.answered(event.of, message.t, event.t_board)
                if self._state is LinkState.RUNNING and event.code:
                    self._refused(event)
            case Beat():
                self._note(event.state)
                self._tally.device_corrupt, self._tally.device_lost = event.bad, event.missed
            case Greeting():
                if self._state is LinkState.RUNNING and event.state is DeviceState.WAIT and not self.lock_step:
                    raise LinkError("the robot started anew", where=f"{self.transport.name}, reading",
                                    expected="a robot that stays switched on", received="its greeting, in mid-run",
                                    hint=f"r2s2r doctor ports {self.transport.name}")  # fmt: skip
            case Status():
                self._tally.other += 1
                self._tally.last_status = event.text
        return event

    def take_all(self, messages: list[tuple[Reading, float]]) -> None:
        """The readings of one tick in lock-step, at the time of its end [s]: the last one is due."""
        last = max((i for i, (reading, _) in enumerate(messages) if reading.measures), default=-1)
        for i, (reading, t) in enumerate(messages):
            self._tally.stamped(reading.board, t, reading.t_board)
            self._samples.append(self._picture.add(reading, t, due=i == last))

    def next_sample(self) -> Sample | None:
        """The oldest one not yet read."""
        return self._samples.popleft() if self._samples else None

    def forget(self) -> None:
        """Samples from before the conversation."""
        self._samples.clear()

    def _note(self, state: DeviceState | None) -> None:
        if state is None or self._state is not LinkState.RUNNING:
            return
        if state is DeviceState.HELD and not self._held:
            self._tally.held += 1
        self._held = state is DeviceState.HELD
        if state is DeviceState.ESTOP:
            self._latched = self._latched or "the device's emergency stop"
            self._refuse()

    def _refused(self, ack: Ack) -> None:
        self._tally.refused += 1
        if ack.code == 1:
            self._latched = self._latched or "the device's emergency stop"
            self._refuse()
        if ack.code in (2, 3, 5, 7):
            raise LinkError("the robot refuses commands", where=self.transport.name, expected="code 0",
                            received=f"code {ack.code}: {handshake.CODES[ack.code]}",
                            hint=f"r2s2r doctor ports {self.transport.name}")  # fmt: skip

    # Ends

    def _refuse(self) -> None:
        if self._latched:
            raise SafetyStop(f"the robot is stopped: {self._latched}", where=self.transport.name,
                             expected="an explicit reset", received="latched",
                             hint=f"r2s2r doctor ports {self.transport.name} --reset")  # fmt: skip
        if self._state is not LinkState.RUNNING:
            raise LinkError("there is no link to the robot", where=self.transport.name, expected="running",
                            received=self._state.value, hint=f"r2s2r doctor ports {self.transport.name}")  # fmt: skip

    @contextlib.contextmanager
    def _dying(self) -> Iterator[None]:
        """A LinkError inside: stop by whatever way is left, then let it out, saying what became of the motors."""
        try:
            yield
        except LinkError as error:
            self._state = LinkState.LOST
            error.received += f"; {self._rescue()}"
            raise

    def _rescue(self) -> str:
        """Say stop on the old connection or on a new one; what can be said of the motors then."""
        self.stop()
        end = time.monotonic() + RESCUE
        if self.codec.watchdog is not None:
            return f"the robot stops by itself after {self.codec.watchdog * 1e3:g} ms"
        while True:
            try:
                self.transport.open()
                self.send(self.codec.stop())
                return "a stop was sent on a new connection, which this protocol does not confirm"
            except LinkError:
                if time.monotonic() >= end:
                    return "A STOP COULD NOT BE SENT: SWITCH THE ROBOT OFF"
                time.sleep(STOP_PAUSE)

    def _last_words(self) -> None:
        """Stop, until it is acknowledged or has been said often enough."""
        try:
            for _ in range(STOPS):
                line = self.codec.stop()
                self.routes.silence()
                self.send(line)
                if self.lock_step:
                    return self.lock_step.tick(self)
                if self._acknowledged(line):
                    return
        except LinkError:
            self._rescue()

    def _acknowledged(self, line: Outgoing) -> bool:
        """Whether the answer to a line comes within STOP_PAUSE."""
        end = time.monotonic() + STOP_PAUSE
        while (left := end - time.monotonic()) > 0:
            message = self.transport.receive(left)
            event = self.take(message) if message else None
            if isinstance(event, Ack) and event.of == line.seq and event.code == 0:
                return True
        return False

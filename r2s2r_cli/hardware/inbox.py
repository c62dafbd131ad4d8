"""What comes in from a robot: counted, answered where that is due, kept as samples until they are read."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from r2s2r_cli.devices.link import LinkError, LinkState, Sample
from r2s2r_cli.hardware.codec.base import Ack, Beat, Corrupt, DeviceState, Event, Greeting, LockStep, Reading, Status
from r2s2r_cli.hardware.handshake import CODES
from r2s2r_cli.hardware.look import look_at
from r2s2r_cli.hardware.transport import Message
from r2s2r_cli.hardware.wiring import Picture, Wiring

if TYPE_CHECKING:
    from r2s2r_cli.hardware.link import Link


class Inbox:
    """Of one link, over its reconnections."""

    def __init__(self, link: Link, wiring: Wiring) -> None:
        self._link = link
        self._picture = Picture(wiring, link.period)
        self._samples: deque[Sample] = deque()
        self._held = False

    def restart(self) -> None:
        """The port was opened again: nothing is known of the robot."""
        self._samples.clear()
        self._picture.restart()
        self._held = False

    def next_sample(self) -> Sample | None:
        """The oldest one not yet read."""
        return self._samples.popleft() if self._samples else None

    def forget(self) -> None:
        """Samples from before the conversation."""
        self._samples.clear()

    def take(self, message: Message) -> Event | None:
        """Count a message, answer it where that is due, keep its sample.

        Gives the event, or None where it is to be ignored (repeated, late). Raises LinkError, SafetyStop.
        """
        link, tally = self._link, self._link.tally
        event = link.codec.decode(message.line)
        if isinstance(event, Corrupt):
            tally.corrupt += 1
            return event
        board = event.board if isinstance(event, Reading) and event.measures else None
        answer = link.routes.heard(message.source, board)
        if answer is not None:
            link.answer(answer, message.source)
        tally.heard(message.t)
        numbers = tally.numbers
        if numbers and event.seq is not None:
            if isinstance(event, Greeting):
                numbers.greeted(event.seq)
            elif not numbers.new(event.seq, event.board if isinstance(event, Reading) else None):
                return None
        if isinstance(event, LockStep):  # how often it is said the wall's clock decides
            return event
        tally.received += 1
        match event:
            case Reading():
                self._note(event.state)
                if not link.lock_step:
                    tally.stamped(event.board, message.t, event.t_board)
                self._samples.append(self._picture.add(event, message.t))
            case Ack():
                tally.answered(event.of, message.t, event.t_board)
                if link.state is LinkState.RUNNING and event.code:
                    self._refused(event)
            case Beat():
                self._note(event.state)
                tally.device_corrupt, tally.device_lost = event.bad, event.missed
            case Greeting():
                if link.state is LinkState.RUNNING and event.state is DeviceState.WAIT and not link.lock_step:
                    raise LinkError("the robot started anew", where=f"{link.transport.name}, reading",
                                    expected="a robot that stays switched on", received="its greeting, in mid-run",
                                    hint=look_at(link.transport.name, link.codec.name))  # fmt: skip
            case Status():
                tally.other += 1
                tally.last_status = event.text
        return event

    def take_tick(self, readings: list[Reading], t: float) -> None:
        """The readings of one tick in lock-step, at the time of its end [s]: the last one is due."""
        last = max((i for i, reading in enumerate(readings) if reading.measures), default=-1)
        for i, reading in enumerate(readings):
            self._link.tally.stamped(reading.board, t, reading.t_board)
            self._samples.append(self._picture.add(reading, t, due=i == last))

    def _note(self, state: DeviceState | None) -> None:
        """What the device says of its state. Raises SafetyStop where its emergency stop is latched."""
        if state is None or self._link.state is not LinkState.RUNNING:
            return
        if state is DeviceState.HELD and not self._held:
            self._link.tally.held += 1
        self._held = state is DeviceState.HELD
        if state is DeviceState.ESTOP:
            self._link.latched_there()

    def _refused(self, ack: Ack) -> None:
        """A command was not obeyed. Raises SafetyStop, LinkError where the next one will not be either."""
        self._link.tally.refused += 1
        port = self._link.transport.name
        if ack.code == 1:
            self._link.latched_there()
        if ack.code in (2, 3, 5, 7):
            raise LinkError("the robot refuses commands", where=port, expected="code 0",
                            received=f"code {ack.code}: {CODES[ack.code]}",
                            hint=look_at(port, self._link.codec.name))  # fmt: skip

"""How a conversation begins: who is there, does it speak our protocol, is it the robot of robot.toml."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from r2s2r_cli.devices.link import WATCHDOG_S, LinkError, LinkFacts, SafetyStop
from r2s2r_cli.hardware.codec import PROTOCOLS
from r2s2r_cli.hardware.codec.base import Ack, Beat, Corrupt, DeviceState, Event, Greeting, LockStep, Reading, Status
from r2s2r_cli.hardware.codec.checked import VERSION
from r2s2r_cli.hardware.lock_step import LockStepClock
from r2s2r_cli.hardware.look import look_at

if TYPE_CHECKING:
    from r2s2r_cli.hardware.link import Link

AGAIN = 0.5
"""[s] after which a hello is said again."""
CODES = {
    0: "done",
    1: "emergency stop is latched",
    2: "a speed is outside -1 to 1",
    3: "no hello yet",
    4: "number not newer than the last one",
    5: "another version of the protocol",
    6: "nothing to reset",
    7: "wrong number of speeds",
}


class _Heard:
    """What came in while we wait for the robot."""

    def __init__(self) -> None:
        self.boards: set[int] = set()
        self.acked: int | None = None
        self.greeting: Greeting | None = None
        self.period = 0.0
        self.status = ""
        self.corrupt = b""
        self.odd = b""
        self.lines = 0

    def note(self, event: Event | None, line: bytes, hello: int | None) -> None:
        """One more message."""
        self.lines += 1
        match event:
            case Reading(measures=True):
                self.boards.add(event.board)
            case Greeting():
                self.greeting = event
                self.period = event.lock_step
            case LockStep():
                self.period = event.period
            case Ack() if event.of == hello:
                self.acked = event.code
            case Status():
                self.status = event.text
                self.odd = self.odd or line
            case Corrupt():
                self.corrupt = self.corrupt or line


def shake(link: Link) -> None:
    """Wait for the robot and look at what it says of itself. Raises LinkError, or SafetyStop where it is latched."""
    heard = _Heard()
    begin = time.monotonic()
    end, again, hello, addressed = begin + link.handshake_timeout, begin, None, False
    while not _complete(link, heard):
        now = time.monotonic()
        if now >= end:
            raise _nobody(link, heard)
        if now >= again:
            again = now + AGAIN
            line = link.codec.hello()
            if line is not None:
                link.send(line)
                hello = line.seq
        message = link.transport.receive(max(0.0, min(again, end) - time.monotonic()))
        if message is not None:
            if message.source is not None and not addressed:
                addressed, again = True, begin  # only now is it known where to say hello
            heard.note(link.inbox.take(message), message.line, hello)
            _refuse(link, heard)
    link.greeting = heard.greeting
    link.inbox.forget()
    if heard.period > 0:
        link.lock_step = LockStepClock(heard.period)
        link.lock_step.tick(link)  # tells the world's time, and the addresses of all boards
        link.inbox.forget()


def _complete(link: Link, heard: _Heard) -> bool:
    if link.codec.numbered:
        return heard.acked == 0 and heard.greeting is not None
    return heard.period > 0 or len(heard.boards) >= link.codec.boards


def _refuse(link: Link, heard: _Heard) -> None:
    """Raises where what the robot says of itself cannot be right."""
    port, greeting = link.transport.name, heard.greeting
    if heard.acked == 1 or (greeting is not None and greeting.state is DeviceState.ESTOP):
        raise SafetyStop("the robot's emergency stop is latched", where=port, expected="an explicit reset",
                         received="latched", hint=look_at(port, link.codec.name, reset=True))  # fmt: skip
    if greeting is None:
        return
    ours = (VERSION, len(link.robot.motors), len(link.robot.sensors))
    theirs = (greeting.version, greeting.motors, greeting.sensors)
    for name, expected, received in zip(("version", "motors", "sensors"), ours, theirs, strict=True):
        if expected != received:
            what = "the robot speaks another version of the protocol" if name == "version" else \
                   f"the robot has another number of {name} than robot.toml"  # fmt: skip
            raise LinkError(what, where=f"{port}, handshake", expected=f"{name} {expected}",
                            received=f"{name} {received} ({greeting.robot}, firmware {greeting.firmware})",
                            hint=look_at(port, link.codec.name))  # fmt: skip


def _nobody(link: Link, heard: _Heard) -> LinkError:
    """What to say when the time is up."""
    port, protocol = link.transport.name, link.codec.name
    where, limit = f"{port}, handshake", f"{link.handshake_timeout:g} s"
    if heard.boards and len(heard.boards) < link.codec.boards:
        silent = [str(i) for i in range(link.codec.boards) if i not in heard.boards]
        told = f"; a board says {heard.status!r}" if heard.status else ""
        return LinkError(
            "not all boards of the robot are there", where=where, expected=f"boards 0 to {link.codec.boards - 1}",
            received=f"nothing from board {', '.join(silent)} in {limit}{told}", hint=look_at(port, protocol),
        )  # fmt: skip
    strange = heard.corrupt or heard.odd  # to a protocol with status texts, lines of another one are such texts
    other = next((name for name in PROTOCOLS if strange and name != protocol and _fits(link, name, strange)), None)
    if heard.corrupt or other:
        return LinkError(
            f"what comes is not the protocol {protocol}", where=where, expected=f"lines of {protocol}",
            received=repr(strange[:40].decode("ascii", "replace")) + (f", which is {other}" if other else ""),
            hint=look_at(port, other or protocol),
        )  # fmt: skip
    received = f"{heard.lines} lines, none of them an answer" if heard.lines else f"nothing in {limit}"
    if heard.status:
        received += f"; the last: {heard.status!r}"
    hint = "ip -brief address   # boards must send to an address of this machine" if port.startswith("udp:") else \
           "r2s2r doctor ports"  # fmt: skip
    return LinkError("the robot does not answer", where=where, expected=f"a robot that speaks {protocol}",
                     received=received, hint=hint)  # fmt: skip


def _fits(link: Link, protocol: str, line: bytes) -> bool:
    """Whether another protocol understands this line."""
    try:
        other = PROTOCOLS[protocol](sensors=len(link.robot.sensors), motors=len(link.robot.motors))
    except Exception:  # it cannot carry this robot
        return False
    return isinstance(other.decode(line), Reading | Greeting | LockStep | Ack | Beat)


def facts(link: Link) -> LinkFacts:
    """What the handshake told, and what the protocol promises."""
    greeting = link.greeting
    remarks = [link.codec.promise] if link.codec.promise else []
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", link.robot.name)
    if greeting is not None and greeting.robot != name:
        remarks.append(f"the robot calls itself {greeting.robot}, robot.toml is of {link.robot.name}")
    told = greeting.watchdog if greeting is not None else link.codec.watchdog
    found = LinkFacts(
        port=link.transport.name, protocol=link.codec.name, version=str(greeting.version) if greeting else "",
        device=greeting.firmware if greeting else "", robot=greeting.robot if greeting else "",
        watchdog=told, lock_step=link.lock_step is not None,
        sensors=len(link.robot.sensors), motors=len(link.robot.motors),
    )  # fmt: skip
    if told is not None and not found.stops_by_itself:
        remarks.append(
            f"the robot's watchdog is {f'{told * 1e3:g} ms, more than {WATCHDOG_S * 1e3:g} ms' if told else 'off'}: "
            "this host cannot guarantee a stop"
        )
    return replace(found, remarks=tuple(remarks))


def unlatch(link: Link) -> None:
    """Ask the device to take its latch off, then greet it. Raises LinkError where it does not."""
    port, asked = link.transport.name, set[int | None]()
    if link.codec.reset() is None:
        return shake(link)
    begin = time.monotonic()
    end, again, addressed = begin + link.handshake_timeout, begin, False
    while (now := time.monotonic()) < end:
        if now >= again:
            again = now + AGAIN
            line = link.codec.reset()
            if line is not None:
                link.send(line)
                asked.add(line.seq)
        message = link.transport.receive(max(0.0, min(again, end) - time.monotonic()))
        if message is None:
            continue
        if message.source is not None and not addressed:
            addressed, again = True, begin  # only now is it known where to ask
        event = link.inbox.take(message)
        if not isinstance(event, Ack) or event.of not in asked:
            continue
        if event.code in (0, 6):
            return shake(link)
        raise LinkError("the robot refuses the reset", where=port, expected="code 0",
                        received=f"code {event.code}: {CODES.get(event.code, 'unknown')}",
                        hint=look_at(port, link.codec.name))  # fmt: skip
    raise LinkError("the robot does not confirm the reset", where=port, expected="code 0",
                    received=f"nothing in {link.handshake_timeout:g} s",
                    hint=look_at(port, link.codec.name, reset=True))  # fmt: skip

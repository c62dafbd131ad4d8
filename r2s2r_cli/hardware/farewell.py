"""How a conversation ends: with a stop that is acknowledged, or said as often and by as many ways as there are."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from r2s2r_cli.devices.link import STOP_PAUSE, STOPS, LinkError
from r2s2r_cli.hardware.codec.base import Ack, Outgoing

if TYPE_CHECKING:
    from r2s2r_cli.hardware.link import Link

RESCUE = 2.0
"""[s] for which a dead port is tried again, to say stop to a robot that does not stop by itself: a host that changes
from one radio cell to the next is without a network for about a second."""


def say_stop(link: Link) -> None:
    """On a link that works: until it is acknowledged or has been said often enough; on one that dies: `rescue`."""
    try:
        for _ in range(STOPS):
            # Of an emergency stop the first line may be lost like any other, and the device is to be latched.
            line = link.codec.emergency() if link.latched_here else link.codec.stop()
            link.routes.silence()
            link.send(line)
            if link.lock_step:
                return link.lock_step.tick(link)
            if _acknowledged(link, line):
                return
    except LinkError:
        rescue(link)


def rescue(link: Link) -> str:
    """Say stop on the old connection or on a new one; what can be said of the motors then."""
    link.stop()
    end = time.monotonic() + RESCUE
    facts = link.facts
    if facts.watchdog is not None and facts.stops_by_itself:
        return f"the robot stops by itself after {facts.watchdog * 1e3:g} ms"
    while True:
        try:
            link.transport.open()
            link.send(link.codec.stop())
            return "a stop was sent on a new connection, and nothing confirms it"
        except LinkError:
            if time.monotonic() >= end:
                return "A STOP COULD NOT BE SENT: SWITCH THE ROBOT OFF"
            time.sleep(STOP_PAUSE)


def _acknowledged(link: Link, line: Outgoing) -> bool:
    """Whether the answer to a line comes within STOP_PAUSE."""
    end = time.monotonic() + STOP_PAUSE
    while (left := end - time.monotonic()) > 0:
        message = link.transport.receive(left)
        event = link.inbox.take(message) if message else None
        if isinstance(event, Ack) and event.of == line.seq and event.code == 0:
            return True
    return False

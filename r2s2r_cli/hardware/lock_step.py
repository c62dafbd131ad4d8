"""A rig that waits for us: time goes on by one control tick when we ask for it, and stands still otherwise."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from r2s2r_cli.devices.link import LinkError, Sample
from r2s2r_cli.hardware.codec.base import Reading, TickDone
from r2s2r_cli.hardware.look import look_at

if TYPE_CHECKING:
    from r2s2r_cli.hardware.link import Link

ASK_AGAIN = 0.5
"""[s] of the wall's clock without an answer, after which a tick is asked again (a datagram may be lost)."""
GIVE_UP = 10.0
"""[s] of the wall's clock without an answer, after which the rig is gone."""


class LockStepClock:
    """t: the world's time at the end of the last tick [s]. k: its number."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.t = 0.0
        self.k = 0

    def read(self, link: Link, timeout: float) -> Sample | None:
        """The next sample; the world goes on until there is one, by `timeout` [s] of its time and a tick at most.

        A time-out above 0 is a tick at least, be it as short as a rounding error: a loop until some time gets there.
        """
        end, waits = self.t + timeout, timeout > 0
        while (sample := link.inbox.next_sample()) is None and waits:
            self.tick(link)
            waits = self.t < end - 1e-9
        return sample

    def tick(self, link: Link) -> None:
        """One tick of the world. Raises LinkError where the rig does not answer."""
        k = self.k + 1
        readings: list[Reading] = []
        end = time.monotonic() + GIVE_UP
        while True:
            link.send(link.codec.tick(k))
            again = time.monotonic() + ASK_AGAIN
            while (left := again - time.monotonic()) > 0:
                message = link.transport.receive(left)
                if message is None:
                    continue
                event = link.inbox.take(message)
                if isinstance(event, Reading):
                    readings.append(event)
                if isinstance(event, TickDone) and event.k == k:
                    self.k, self.t = k, event.t
                    link.inbox.forget()  # stamped by the wall's clock; below by the world's
                    return link.inbox.take_tick(readings, event.t)
            if time.monotonic() > end:
                raise LinkError(
                    "the rig does not answer", where=f"{link.transport.name}, tick {k}", expected="the end of the tick",
                    received=f"nothing in {GIVE_UP:g} s", hint=look_at(link.transport.name, link.codec.name),
                )  # fmt: skip

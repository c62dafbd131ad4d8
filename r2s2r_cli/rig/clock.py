"""The rig's time: that of the wall, or ticks that a host asks for."""

from __future__ import annotations

import time
from collections.abc import Callable


class RealClock:
    """Seconds since the rig began. Never runs backwards."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now, self._start = now, now()

    @property
    def t(self) -> float:
        """The world's time [s]."""
        return self._now() - self._start


class TickClock:
    """Time that stands still between ticks, and which tick a host may ask for next. tick: its length [s]."""

    def __init__(self, tick: float) -> None:
        self.tick = tick
        self._ticks = 0
        self._k = 0

    @property
    def t(self) -> float:
        """The world's time [s]."""
        return self._ticks * self.tick

    @property
    def started(self) -> bool:
        """A tick was asked for since the last first contact."""
        return self._k > 0

    @property
    def us(self) -> int:
        """Length of a tick [us]."""
        return round(self.tick * 1e6)

    def contact(self) -> None:
        """A host has come: it counts its ticks from 1."""
        self._k = 0

    def asked(self, k: int) -> bool | None:
        """What to do for tick k. True: advance; False: it is done, answer again; None: pass over.

        Over datagrams nothing tells of a new host but that it asks for tick 1, nor where a port was closed and opened
        again between two looks at it.
        """
        if k == self._k:
            return False
        if k in (1, self._k + 1):
            self._k = k
            return True
        return None

    def advance(self) -> None:
        """One tick has passed."""
        self._ticks += 1

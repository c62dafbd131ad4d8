"""Whether the host reads as fast as the robot sends. Pure: looks at the clock and samples in, a reason or "" out.

A message is stamped when it is read, so that one which has waited looks fresh: a host that is slower than the robot
drives on ever older readings, and no other duty notices.
"""

from __future__ import annotations

from r2s2r_cli.devices.link import Sample
from r2s2r_cli.hardware.watch import STALE

UNEMPTIED = 1.0
"""[s] for which there may always be something that waits, outside the longest pause of the host in that time ..."""
_WHY = "this host cannot keep up with the robot: what it drives on has waited"


class Pace:
    """Of a conversation. period [s]: between two readings of a board.

    A host that stood still once has a backlog, which it works off: that one pause is forgiven. What came since then has
    waited for as long as it took to read it, less the time of the robot that it covers.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Nothing waits at the time `now` [s]."""
        self._emptied = self._looked = now
        self._longest = 0.0
        self._read: dict[int, int] = {}

    def sample(self, sample: Sample) -> None:
        """One that was read."""
        self._read[sample.board] = self._read.get(sample.board, 0) + bool(sample.fresh.any())

    def look(self, now: float, *, waits: bool) -> str:
        """A reason to stop at the time `now` [s], or "". waits: there is something to be read."""
        if not waits:
            self.restart(now)
            return ""
        self._longest, self._looked = max(self._longest, now - self._looked), now
        behind = now - self._emptied - self._longest
        # Messages of several boards tell of the same time.
        age = behind - self._period * max(self._read.values(), default=0)
        if age > STALE:
            return f"{_WHY} for {1e3 * age:.0f} ms"
        return f"{_WHY} again and again for {UNEMPTIED:g} s" if behind > UNEMPTIED else ""

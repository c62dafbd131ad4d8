"""Whether the filter believes its own states: what was refused, what was not seen, what contradicts rods and sensors.

Rods and cables hold the caps together, so a robot that is taken to be at a wrong place, or to lie on another side, fits
its sensors as well as the right one, and one cap that happens to be where another was expected keeps all the others
certain. What tells is that the others are not seen. So whoever was in doubt about the whole robot stays so until the
caps were told apart anew, or nearly all of them were seen where they were expected.
"""

from __future__ import annotations

import numpy as np

REFUSED = 5
"""Frames in a row that may refuse a cap, or contradict rods and sensors, before it counts as lost."""
BLIND_S = 0.3
"""[s] After so long without any cap, where they are is looked for afresh."""
FRESH_S = 0.1
"""[s] A cap seen no longer ago than this is in sight."""
MISSED_S, AGAIN_S = 0.2, 0.5
"""[s] A cap that is missed for the first may be elsewhere: it is looked for everywhere, and again after the second."""


class Doubt:
    """Counters of one filter. caps: how many. Raises nothing."""

    def __init__(self, caps: int) -> None:
        self.unseen = np.zeros(caps)
        """[s] Since each cap was last seen, (cap,)."""
        self._refused = np.zeros(caps, dtype=int)
        self._wrong = 0
        self._astray = False
        self._asked = 0.0

    @property
    def in_sight(self) -> np.ndarray:
        """Caps that were seen just now, bool (cap,)."""
        return np.asarray(self.unseen <= FRESH_S)

    @property
    def whole(self) -> bool:
        """The robot as a whole may be elsewhere."""
        return bool(self._astray or np.any(self._refused >= REFUSED) or self._wrong >= REFUSED)

    @property
    def missing(self) -> bool:
        """Some cap is not where it is expected, and has not been looked for elsewhere of late."""
        return bool(np.any(self.unseen > MISSED_S) and self._asked > AGAIN_S)

    def believe(self) -> None:
        """Nothing speaks against the states (any more)."""
        self._refused[:] = 0
        self.unseen[:] = 0.0
        self._wrong = 0
        self._astray = False
        self._asked = AGAIN_S

    def searched(self) -> None:
        """The caps were looked for everywhere, just now."""
        self._asked = 0.0

    def wait(self, seconds: float) -> None:
        """Time goes by."""
        self.unseen += seconds
        self._asked += seconds
        self._astray |= bool(np.all(self.unseen > BLIND_S))

    def look(self, seen: np.ndarray, used: np.ndarray) -> None:
        """A frame in which caps were `seen` near their predictions, and `used`, bool (cap,) each."""
        self._refused = np.where(used, 0, np.where(seen, self._refused + 1, self._refused))
        self.unseen[used] = 0.0

    def judge(self, *, consistent: bool, used: np.ndarray) -> None:
        """After such a frame. consistent: rods and sensors are as long as they should be."""
        self._wrong = 0 if consistent else self._wrong + 1
        if consistent and np.sum(~used) <= 1:
            self._astray = False

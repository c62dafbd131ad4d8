"""One board as a thing in time: when it samples, what its clock shows, when it is down."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.firmware.layout import Post
from r2s2r_cli.rig.world.faults import BoardReset, BoardSilent, ClockJump
from r2s2r_cli.rig.world.file import World

_JITTER_MAX = 0.4
"""Of a period: samples of a board stay in order."""
_MICRO = 1e-6


class Board:
    """Rate, phase, clock and faults of one board."""

    def __init__(self, number: int, post: Post, world: World, rng: np.random.Generator) -> None:
        s = world.boards
        self.number, self.post = number, post
        self._rng, self._jitter = rng, s.jitter_s
        self._period = 1.0 / (s.rate_hz * (1.0 + s.rate_spread * float(np.clip(rng.standard_normal(), -3, 3))))
        self._phase = float(rng.random())
        self._zero = -s.clock_spread_s * float(rng.random())
        self._rate = 1.0 + s.clock_drift * float(rng.standard_normal())
        mine = [fault for fault in world.faults if getattr(fault, "board", None) == number]
        self._silent = [fault for fault in mine if isinstance(fault, BoardSilent)]
        self._resets = sorted((fault for fault in mine if isinstance(fault, BoardReset)), key=lambda f: f.at_s)
        self._jumps = [fault for fault in mine if isinstance(fault, ClockJump)]
        self._k = 0
        self._greeted = 0
        self.due = self._next()
        """When it samples next [s]."""

    def clock(self, t: float) -> float:
        """What its clock shows at the rig's time t [s], in whole microseconds."""
        zero = self._zero
        for reset in self._resets:
            if t >= reset.at_s + reset.for_s:
                zero = reset.at_s + reset.for_s
        shown = (t - zero) * self._rate + sum(jump.by_s for jump in self._jumps if jump.on(t))
        return round(max(shown, 0.0) / _MICRO) * _MICRO

    def down(self, t: float) -> bool:
        """It starts anew: it neither sends nor obeys."""
        return any(reset.on(t) for reset in self._resets)

    def silent(self, t: float) -> bool:
        """It sends nothing."""
        return self.down(t) or any(fault.on(t) for fault in self._silent)

    def restarts(self, begin: float, end: float) -> list[float]:
        """When resets begin within (begin, end] [s]."""
        return [reset.at_s for reset in self._resets if begin < reset.at_s <= end]

    def greeting(self, t: float) -> str | None:
        """The text with which it comes back, once after each reset."""
        back = sum(t >= reset.at_s + reset.for_s for reset in self._resets)
        if back == self._greeted:
            return None
        self._greeted = back
        return f"BOARD {self.number} READY"

    def sampled(self) -> None:
        """The sample that was due is taken."""
        self._k += 1
        self.due = self._next()

    def _next(self) -> float:
        jitter = self._jitter * float(self._rng.standard_normal())
        most = _JITTER_MAX * self._period
        return (self._k + self._phase) * self._period + float(np.clip(jitter, -most, most))

"""The electronics of a tier A robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from r2s2r_cli.blind.make.body import Body

NOISE_SD_M = 0.0005
"""Of a length reading."""


class EngineBoards:
    """One board without a clock of its own: every reading is of now, with white noise."""

    def __init__(self, body: Body, rng: np.random.Generator, motors: int) -> None:
        self._body, self._rng, self._duty, self._t = body, rng, np.zeros(motors), 0.0

    @property
    def duty(self) -> np.ndarray:
        """What the drivers have, (motor,)."""
        return self._duty.copy()

    def hear(self, t: float) -> None:
        """Go on to t [s]."""
        if t > self._t:
            self._body.advance(t - self._t, self._duty)
            self._t = t

    def length(self) -> np.ndarray:
        """Read now [m], (cable,)."""
        length = self._body.sensed()
        return length + NOISE_SD_M * self._rng.standard_normal(len(length))

    def command(self, duty: np.ndarray) -> None:
        """Set the drivers."""
        self._duty = np.clip(duty, -1.0, 1.0)

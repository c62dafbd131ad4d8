"""What the sensors said: the newest lengths, and the means of those that came since the states were last told."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

OLD_S = 0.2
"""[s] A length that was shown longer ago says nothing any more."""


class Means(NamedTuple):
    """Mean lengths [m], NaN where none came; how much later than now they were shown [s]; their noise as standard
    deviation [m]. (sensor,) each."""

    length: np.ndarray
    later: np.ndarray
    noise: np.ndarray


class Heard:
    """Lengths of so many sensors. shown: the newest of each [m], (sensor,), NaN where it is too old. Raises nothing."""

    def __init__(self, sensors: int) -> None:
        self.shown, self._when = np.full((2, sensors), np.nan)
        self._count, self._sum, self._late = (np.zeros(sensors) for _ in range(3))

    def take(self, t: float, length: np.ndarray) -> None:
        """Lengths at time t [s], (sensor,) [m], NaN where there is none."""
        good = np.isfinite(length)
        self.shown, self._when = np.where(good, length, self.shown), np.where(good, t, self._when)
        self._count += good
        self._sum += np.where(good, length, 0.0)
        self._late += np.where(good, t, 0.0)

    def means(self, now: float, noise_sd: float) -> Means | None:
        """Of what came since the last call; None where nothing did. noise_sd: of one length [m]."""
        heard = self._count > 0
        if not np.any(heard):
            return None
        some = np.maximum(self._count, 1)
        length = np.where(heard, self._sum / some, np.nan)
        later = np.where(heard, self._late / some - now, 0.0)
        noise = noise_sd / np.sqrt(some)
        self._count, self._sum, self._late = (np.zeros(len(some)) for _ in range(3))
        return Means(length, later, noise)

    def forget(self, now: float) -> None:
        """Drop newest lengths that are too old by now [s]."""
        self.shown[np.abs(now - self._when) > OLD_S] = np.nan

"""When the camera looks, what its clock says then, and what becomes of the frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.camera.settings import CameraSettings

_JITTER_LIMIT = 0.25
"""Share of the time between frames by which one may come early or late."""


@dataclass(frozen=True)
class Exposure:
    """One frame to come. t: middle of its exposure, rig time [s]; stamp: what the camera's clock will say [s]; lost: it
    will not leave the camera."""

    number: int
    t: float
    stamp: float
    lost: bool


class Shutter:
    """The exposures one after the other; `next` is the one to come. Equal seeds give equal exposures."""

    def __init__(self, settings: CameraSettings, *, seed: int = 0) -> None:
        self._clock, self._faults, self._seed = settings.clock, settings.faults, seed
        self.next = self._exposure(0)

    def advance(self) -> None:
        """Go on to the next frame."""
        self.next = self._exposure(self.next.number + 1)

    def release(self, exposure: Exposure) -> float:
        """Rig time at which this frame leaves the camera [s]."""
        return exposure.t + self._clock.latency_s

    def gone(self, t: float) -> bool:
        """Whether the camera has been unplugged."""
        return self._faults.gone_at_s is not None and t >= self._faults.gone_at_s

    def stalled(self, t: float) -> bool:
        """Whether it says nothing at present."""
        return within(t, self._faults.stalled_from_s, self._faults.stalled_until_s)

    def frozen(self, t: float) -> bool:
        """Whether it sends the same picture again and again."""
        return within(t, self._faults.frozen_from_s, self._faults.frozen_until_s)

    def _exposure(self, number: int) -> Exposure:
        clock = self._clock
        rng = np.random.default_rng([self._seed, 2, number])
        lost = bool(rng.random() < clock.lost_share)
        rate = 1.0 + 1e-6 * clock.drift_ppm
        period = 1.0 / (clock.rate_hz * rate)
        late = float(np.clip(rng.standard_normal() * clock.jitter_s, -_JITTER_LIMIT * period, _JITTER_LIMIT * period))
        t = max(number * period + late, 0.0)
        stamp = clock.origin_s + rate * (t + clock.stamp_delay_s)
        if self._faults.clock_jump_at_s is not None and t >= self._faults.clock_jump_at_s:
            stamp += self._faults.clock_jump_s
        return Exposure(number, t, stamp, lost)


def within(t: float, start: float | None, stop: float | None) -> bool:
    """Whether t lies in start .. stop; no start: never, no stop: for ever."""
    return start is not None and t >= start and (stop is None or t < stop)

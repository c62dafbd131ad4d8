"""How wrong a depth is, as the floor shows it; in inverse depth, where stereo noise is the same everywhere.

By how far a pixel looks past itself a flat floor does not show: that is taken for granted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LAGS_PX = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20)
_LENGTHS_PX = np.geomspace(1.0, 24.0, 40)
_SD_LEAST = 1e-5
_MOSTLY = 0.6
_SIDEWAYS_PX = 0.6
"""Not measured: of stereo cameras half a pixel and rounding (simkinect, perception.md section 5)."""


@dataclass(frozen=True)
class DepthNoise:
    """Noise of 1 / z [1/m]: a part that every pixel has for itself and one that neighbours share.

    white, shared: standard deviations [1/m]; sd of z is z^2 times them. length_px: distance at which the correlation
    of the shared part has fallen to 1/e, exp(-(d / length)^2). sideways_px: by which a pixel looks past itself.
    """

    white: float = 0.00085
    shared: float = 0.00085
    length_px: float = 6.0
    sideways_px: float = _SIDEWAYS_PX

    @property
    def sd(self) -> float:
        """Of one pixel [1/m]."""
        return float(np.hypot(self.white, self.shared))

    def covariance(self, u: np.ndarray, v: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Covariance [1/m^2] (n, n) of the inverse depths of pixels u, v; own: variance that each has besides (n,)."""
        apart = np.subtract.outer(u, u) ** 2 + np.subtract.outer(v, v) ** 2
        C = self.shared**2 * np.exp(-apart / self.length_px**2)
        C[np.diag_indices_from(C)] += self.white**2 + own
        return C


def measured(error: np.ndarray) -> DepthNoise:
    """The noise of a floor. error: inverse depth minus the plane's [1/m], (frame, v, u), NaN where no floor is.

    From the autocovariance along rows and columns: the shared part is the Gaussian that fits lags of 1 .. 20 px best,
    the white part what it leaves of the variance.
    """
    known = np.isfinite(error)
    filled = np.where(known, error, 0.0)
    total = float((filled**2).sum() / max(known.sum(), 1))
    lags = []
    for lag in LAGS_PX:
        one = (filled[..., lag:] * filled[..., :-lag]).sum() + (filled[..., lag:, :] * filled[..., :-lag, :]).sum()
        both = (known[..., lag:] & known[..., :-lag]).sum() + (known[..., lag:, :] & known[..., :-lag, :]).sum()
        lags.append(float(one) / max(int(both), 1))
    covariance = np.maximum(np.array(lags), 0.0)
    best = (np.inf, 0.0, 1.0)
    for length in _LENGTHS_PX:
        shape = np.exp(-((np.array(LAGS_PX) / length) ** 2))
        share = float(np.clip(shape @ covariance / (shape @ shape), 0.0, total))
        best = min(best, (float(((covariance - share * shape) ** 2).sum()), share, float(length)))
    _, shared, length = best
    alone = total - shared
    if covariance[1] > _MOSTLY * total:  # next to a large shared part, a small white one is seen at the first lags only
        alone = total - float(covariance[0] * (covariance[0] / covariance[1]) ** (1 / 3))
    return DepthNoise(
        white=max(float(np.sqrt(max(alone, 0.0))), _SD_LEAST), shared=float(np.sqrt(shared)), length_px=length
    )

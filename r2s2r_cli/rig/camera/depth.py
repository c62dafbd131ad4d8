"""Depth counts from the true depths: noise that grows with z^2, flying pixels, holes, rounding.

All of it is done in inverse depth, where a noise of c z^2 is one of c, the same everywhere: dz = z^2 d(1/z).
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.camera.bank import Bank
from r2s2r_cli.rig.camera.render import View
from r2s2r_cli.rig.camera.settings import CameraSettings

EDGE_M = 0.015
"""Neighbours whose depths differ by more lie on two sides of an edge."""
MARGIN_PX = 6
"""Pixels around the solids that their edges can touch."""
SMEAR_LIMIT_M = 0.1
"""The temporal filter takes a larger change for another thing, and starts anew."""


class DepthSensor:
    """Turns what is there into what the camera reports."""

    def __init__(self, settings: CameraSettings, rng: np.random.Generator) -> None:
        noise, size = settings.depth, (settings.height, settings.width)
        self._noise = noise
        self._counts = (1.0 + settings.depth_error) / settings.depth_scale
        self._step = noise.disparity_step_px / (settings.fx * noise.baseline_m)
        self._white = _scaled(Bank(rng, *size), noise.sd_per_m * np.sqrt(1 - noise.correlated_share))
        shared = noise.sd_per_m * np.sqrt(noise.correlated_share)
        self._shared = _scaled(Bank(rng, *size, noise.correlation_px), shared)
        self._blobs = Bank(rng, *size, noise.hole_px) if noise.hole_share > 0 else None
        self._blob_limit = float(np.quantile(self._blobs.field, 1 - noise.hole_share)) if self._blobs else 0.0
        self._last: np.ndarray | None = None

    def report(self, floor: np.ndarray, view: View, rng: np.random.Generator) -> np.ndarray:
        """Depth counts (v, u) uint16, 0 where nothing is known.

        floor: 1 / z of what stands still [1/m], (v, u) float32, 0 where nothing is. view: the solids.
        """
        inverse = floor.copy()
        holes: np.ndarray | None = None
        if view.z.size:
            part = inverse[view.rows, view.columns]
            np.maximum(part, (1.0 / view.z).astype(np.float32), out=part)
            part[:], holes = self._edges(part, rng)
        known = inverse > 0
        if self._white is not None:
            inverse += self._white.window(rng)
        if self._shared is not None:
            inverse += self._shared.window(rng)
        if self._step > 0:
            inverse *= 1.0 / self._step
            np.rint(inverse, out=inverse)
            inverse *= self._step
        if self._blobs is not None:
            known &= self._blobs.window(rng) <= self._blob_limit
        if holes is not None:
            known[view.rows, view.columns] &= ~holes
        if self._noise.smear > 0:
            inverse = self._smeared(inverse, known)
        known &= inverse * 65535.0 > self._counts  # farther than a count can tell
        np.copyto(inverse, np.inf, where=~known)
        return np.rint(np.float32(self._counts) / inverse).astype(np.uint16)

    def _edges(self, inverse: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Fray the edges, let some of their pixels fly between front and back, and some report nothing."""
        noise, shape = self._noise, inverse.shape
        if noise.lateral_px > 0:
            side = np.rint(rng.standard_normal((2, *shape), dtype=np.float32) * noise.lateral_px).astype(np.intp)
            rows = np.clip(np.arange(shape[0])[:, None] + side[0], 0, shape[0] - 1)
            columns = np.clip(np.arange(shape[1])[None, :] + side[1], 0, shape[1] - 1)
            inverse = inverse[rows, columns]
        front, back = _extremes(inverse)
        # 1/far - 1/near > EDGE_M for a pixel and one of its neighbours, without the division
        edge = (front - inverse > EDGE_M * front * inverse) | (inverse - back > EDGE_M * inverse * back)
        draw = rng.random((2, *shape), dtype=np.float32)
        holes = edge & (draw[0] < noise.edge_hole_share)
        flying = edge & (draw[0] >= 1 - noise.flying_share) & (back > 0)
        between = 1.0 / (draw[1] / np.maximum(back, 1e-3) + (1 - draw[1]) / np.maximum(front, 1e-3))
        return np.where(flying, between, inverse), holes

    def _smeared(self, inverse: np.ndarray, known: np.ndarray) -> np.ndarray:
        now = np.where(known, inverse, 0.0)
        if self._last is not None:
            last = self._last
            near = np.abs(now - last) < SMEAR_LIMIT_M * now * last
            now = np.where(near, self._noise.smear * last + (1 - self._noise.smear) * now, now)
        self._last = now
        return now.copy()


def _scaled(bank: Bank, sd: float) -> Bank | None:
    if sd <= 0:
        return None
    bank.field *= np.float32(sd)
    return bank


def _extremes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest and smallest of each pixel and its four neighbours."""
    high, low = values.copy(), values.copy()
    for axis in (0, 1):
        one, other = [slice(None)] * 2, [slice(None)] * 2
        one[axis], other[axis] = slice(1, None), slice(None, -1)
        for a, b in ((tuple(one), tuple(other)), (tuple(other), tuple(one))):
            np.maximum(high[a], values[b], out=high[a])
            np.minimum(low[a], values[b], out=low[a])
    return high, low

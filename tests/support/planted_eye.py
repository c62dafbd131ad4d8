"""An eye that sees planted caps as the tracker's eye does: near a prediction, or anywhere without names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.sight_cap import GATE_SD, REACH_M
from r2s2r_cli.stages.estimate.vision.sightings import HIDDEN, SEEN, Candidate, Sightings

LENS = Intrinsics(640, 480, 615.0, 615.0, 320.0, 240.0)
HEIGHT_M, NOISE_M = 1.44, 5e-4
X_WC = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, HEIGHT_M], [0.0, 0.0, 0.0, 1.0]])
"""Looks straight down."""


@dataclass(frozen=True)
class EmptyFrames:
    """A FrameSource of frames at t [s], (frame,), that show nothing: the eye knows what is there."""

    t: np.ndarray
    lens: Intrinsics = LENS
    depth_scale: float = 1e-3
    X_WC: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[ImageFrame]:
        return (self.frame(index) for index in range(len(self)))

    def frame(self, index: int) -> ImageFrame:
        """One of them."""
        return ImageFrame(index, float(self.t[index]), np.zeros((1, 1, 3), np.uint8), None)


class PlantedEye:
    """p_WE: caps [m], (frame, cap, 3). gone: those that are hidden, bool (frame, cap)."""

    def __init__(self, p_WE: np.ndarray, gone: np.ndarray, seed: int = 0) -> None:
        self._p_C, self._gone = (p_WE - X_WC[:3, 3]) @ X_WC[:3, :3], gone
        self._rng = np.random.default_rng(seed)

    def sight(self, frame: ImageFrame, p_C: np.ndarray, cov_C: np.ndarray) -> Sightings:
        """Of the two caps of a rod's colour the one nearer to the prediction, if it is within reach."""
        k, caps = frame.index, len(p_C)
        reach = np.maximum(GATE_SD * np.sqrt(np.trace(cov_C, axis1=1, axis2=2)), REACH_M)
        found = np.full((caps, 3), np.nan)
        for cap in range(caps):
            there = [other for other in (cap, cap ^ 1) if not self._gone[k, other]]
            far = {other: float(np.linalg.norm(self._p_C[k, other] - p_C[cap])) for other in there}
            near = min(far, key=lambda other: far[other], default=None)
            if near is not None and far[near] < reach[cap]:
                found[cap] = self._noisy(k, near)
        seen = np.isfinite(found[:, 0])
        cov = np.broadcast_to(NOISE_M**2 * np.eye(3), (caps, 3, 3)).copy()
        return Sightings(found, cov, seen.astype(float), np.where(seen, SEEN, HIDDEN).astype(np.uint8))

    def detect(self, frame: ImageFrame) -> tuple[Candidate, ...]:
        """All caps that are not hidden, in any order."""
        there = self._rng.permutation(np.flatnonzero(~self._gone[frame.index]))
        return tuple(
            Candidate(int(cap) // 2, self._noisy(frame.index, int(cap)), NOISE_M**2 * np.eye(3), 1.0) for cap in there
        )

    def _noisy(self, k: int, cap: int) -> np.ndarray:
        return np.asarray(self._p_C[k, cap] + NOISE_M * self._rng.standard_normal(3))

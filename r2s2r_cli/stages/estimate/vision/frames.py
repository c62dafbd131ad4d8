"""Frames as the tracker gets them: decoded pictures one after the other, and what is known about their camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics


@dataclass(frozen=True)
class ImageFrame:
    """One moment of a run, colour and depth registered to each other.

    index: row of the frame in its recording. t: since the start of the run [s].
    color: RGB uint8 (v, u, 3). depth: counts uint16 (v, u), 0 where unknown. None: that picture is missing.
    """

    index: int
    t: float
    color: np.ndarray | None
    depth: np.ndarray | None


class FrameSource(Protocol):
    """A run's frames. Iterating decodes them ahead in a thread and never holds more than a few."""

    @property
    def lens(self) -> Intrinsics:
        """Of both pictures."""

    @property
    def depth_scale(self) -> float:
        """Metres a count of depth."""

    @property
    def t(self) -> np.ndarray:
        """Times since the start of the run [s], (frame,)."""

    @property
    def X_WC(self) -> np.ndarray | None:
        """Pose of the camera in the world as the recording states it (4, 4), or None."""

    def __len__(self) -> int:
        """Number of frames."""

    def __iter__(self) -> Iterator[ImageFrame]:
        """All frames in order."""

    def frame(self, index: int) -> ImageFrame:
        """One frame."""

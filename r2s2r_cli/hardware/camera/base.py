"""What every camera gives: registered colour and depth with two stamps, and how it is opened, read and closed."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

import numpy as np


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera; point (x, y, z) of frame C (x right, y down, z forward) is seen at u = fx x / z + cx.

    width, height, fx, fy, cx, cy [px]; pixel centres at u + 0.5, v + 0.5. distortion: OpenCV's coefficients
    (k1, k2, p1, p2, k3), empty where the picture is rectified.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()


@dataclass(frozen=True)
class Frame:
    """One picture. Depth is registered to colour: the same pixel of both sees the same thing.

    color: RGB uint8 (v, u, 3). depth: counts uint16 (v, u), 0 where unknown; times `depth_scale` it is z in frame C.
    t_device: clock of the camera [s], of unknown origin. t_host: host's `time.monotonic` when the frame had come [s].
    number: counted by the camera; a gap is a lost frame.
    """

    color: np.ndarray
    depth: np.ndarray
    t_device: float
    t_host: float
    number: int


class Camera(Protocol):
    """A camera. Used as `with open_camera(...) as camera:`; `intrinsics` and the rest are known once it is open."""

    name: str
    """Model and serial number, for people and for the recording."""

    @property
    def intrinsics(self) -> Intrinsics:
        """Of the pictures as they come."""

    @property
    def depth_scale(self) -> float:
        """Metres a count of depth."""

    @property
    def rate_hz(self) -> float:
        """Frames a second that the camera promises."""

    def open(self) -> None:
        """Connect. Raises HardwareError that names the camera and the next step."""

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame; None where none came in time. Raises HardwareError where the camera is gone, or has no more
        (`CameraEnded`)."""

    def close(self) -> None:
        """Let go. May be called more than once."""

    def __enter__(self) -> Self:
        """Open."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""


class Closing:
    """Makes a camera a context manager, given `open` and `close`."""

    def open(self) -> None:
        """See `Camera.open`."""
        raise NotImplementedError

    def close(self) -> None:
        """See `Camera.close`."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

"""A camera as `record` and `doctor` see it: what every one gives, how it is opened, read and closed, and its errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np

from r2s2r_cli.errors import HardwareError

if TYPE_CHECKING:
    from types import TracebackType


class CameraError(HardwareError):
    """The camera cannot be had, is gone, or sends what cannot be understood."""


class CameraEnded(CameraError):
    """A camera that plays back has no more frames."""


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

    @property
    def name(self) -> str:
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
        """Connect. Raises CameraError that names the camera and the next step."""

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame; None where none came in time. Raises CameraError where the camera is gone, CameraEnded
        where a recording has no more."""

    def close(self) -> None:
        """Let go. May be called more than once."""

    def __enter__(self) -> Self:
        """Open."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""


@dataclass(frozen=True)
class FeedStatistics:
    """Counts since the feed began. received: frames that came. lost: numbers of the camera that never came. repeated:
    frames equal to the one before, to the last bit of depth. overrun: frames thrown away here because nobody took them.
    late_s: longest time between two frames [s]. silent_s: time since the last one [s]."""

    received: int = 0
    lost: int = 0
    repeated: int = 0
    overrun: int = 0
    late_s: float = 0.0
    silent_s: float = 0.0


class CameraFeed(Protocol):
    """Frames of an open camera, read in a thread of their own."""

    @property
    def statistics(self) -> FeedStatistics:
        """What came so far, and what did not."""

    def frames(self) -> list[Frame]:
        """What has come since the last call, in order; never waits. Raises CameraError once the camera is gone and
        all of its frames were taken."""

    def hold(self, on: bool) -> None:
        """While on, a camera that can wait does so instead of frames being thrown away: that of a rig in lock-step,
        whose time does not go on meanwhile. Somebody must take frames then."""

    def close(self) -> None:
        """Stop reading. The camera stays open."""

"""A camera that plays back: a folder of frames, or a run of a recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.camera import CameraEnded, CameraError, Frame, Intrinsics
from r2s2r_cli.hardware.camera.closing import Closing


@dataclass(frozen=True)
class Film:
    """Encoded frames. `pictures()` begins from the start: (colour, depth, stamp [s]) each, PNG or JPEG and 16-bit PNG;
    depth is None where a colour frame has none. stamped: the stamps are the camera's, not made up from the rate."""

    name: str
    intrinsics: Intrinsics
    depth_scale: float
    rate_hz: float
    pictures: Callable[[], Iterator[tuple[bytes, bytes | None, float]]]
    stamped: bool = True


class ReplayCamera(Closing):
    """Frames of a film at the pace of their stamps, or as fast as they are asked for."""

    def __init__(
        self, film: Film, *, loop: bool = False, paced: bool = True, now: Callable[[], float] = time.monotonic
    ) -> None:
        """loop: begin again after the last frame. paced: at the speed at which it was taken."""
        self._film, self._loop, self._paced, self._now = film, loop, paced, now
        self.name, self.intrinsics = film.name, film.intrinsics
        self.depth_scale, self.rate_hz = film.depth_scale, film.rate_hz
        self._pictures: Iterator[tuple[bytes, bytes | None, float]] | None = None
        self._next: Frame | None = None
        self._shift = 0.0
        self._number = 0
        self._begun: tuple[float, float] | None = None

    def open(self) -> None:
        """Begin from the start. Raises CameraError where there is no frame, or the first is of another size."""
        self.close()
        self._pictures = self._film.pictures()
        self._number, self._shift, self._begun = 0, 0.0, None
        self._next = self._advance()

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame when it is due, None if that is later. Raises CameraEnded, or CameraError for a broken one."""
        if self._pictures is None:
            raise self._wrong("the camera is not open", "an open camera", "none")
        if self._next is None:
            self._next = self._again()
        frame = self._next
        if self._paced:
            stamp, start = self._begun or (frame.t_device, time.monotonic())
            self._begun = (stamp, start)
            wait = start + (frame.t_device - stamp) - time.monotonic()
            if wait > timeout_s:
                time.sleep(max(timeout_s, 0.0))
                return None
            time.sleep(max(wait, 0.0))
        try:
            self._next = self._advance()
        except CameraEnded:
            self._next = None
        return Frame(frame.color, frame.depth, frame.t_device, self._now(), frame.number)

    def close(self) -> None:
        """Let go."""
        self._pictures, self._next = None, None

    def _again(self) -> Frame:
        if not self._loop:
            raise CameraEnded(
                "the film has ended", where=self.name, expected="another frame",
                received=f"{self._number} frames in all", hint="--camera replay:FOLDER with a longer one",
            )  # fmt: skip
        last = self._begun
        self._pictures, self._begun = self._film.pictures(), None
        frame = self._advance()
        if last is not None:  # stamps go on rising
            elapsed = time.monotonic() - last[1]
            self._shift = last[0] + elapsed + 1.0 / self.rate_hz - (frame.t_device - self._shift)
            frame = Frame(frame.color, frame.depth, last[0] + elapsed + 1.0 / self.rate_hz, 0.0, frame.number)
        return frame

    def _advance(self) -> Frame:
        picture = next(self._pictures, None) if self._pictures is not None else None
        if picture is None:
            if self._number == 0:
                raise self._wrong("there is no frame to play back", "at least one", "none")
            raise CameraEnded("the film has ended", hint="--camera replay:FOLDER", where=self.name)
        color, depth, stamp = picture
        frame = Frame(
            self._decoded(color, depth=False),
            self._decoded(depth, depth=True)
            if depth is not None
            else np.zeros((self.intrinsics.height, self.intrinsics.width), np.uint16),
            stamp + self._shift, 0.0, self._number,
        )  # fmt: skip
        self._number += 1
        return frame

    def _decoded(self, data: bytes, *, depth: bool) -> np.ndarray:
        import cv2

        what = f"{'depth' if depth else 'colour'} frame {self._number}"
        try:
            mode = cv2.IMREAD_UNCHANGED if depth else cv2.IMREAD_COLOR
            image = cv2.imdecode(np.frombuffer(data, np.uint8), mode)
        except cv2.error:
            image = None
        if image is None:
            raise self._wrong(f"{what} cannot be read", "a PNG or JPEG", f"{len(data)} bytes that are none")
        if depth and (image.ndim != 2 or image.dtype != np.uint16):
            raise self._wrong(f"{what} holds no depth", "16-bit grey", f"{image.dtype}, {image.ndim} axes")
        if image.shape[:2] != (self.intrinsics.height, self.intrinsics.width):
            raise self._wrong(
                f"{what} has another size", f"{self.intrinsics.width} x {self.intrinsics.height} px",
                f"{image.shape[1]} x {image.shape[0]} px",
            )  # fmt: skip
        return np.asarray(image if depth else np.ascontiguousarray(image[:, :, ::-1]))

    def _wrong(self, what: str, expected: str, received: str) -> CameraError:
        return CameraError(what, where=self.name, expected=expected, received=received,
                           hint="see docs/guides/camera.md for what can be played back")  # fmt: skip

"""Pictures of a run: encoded in a thread of their own, beside the control loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

import numpy as np

from r2s2r_cli.devices.camera import CameraFeed, Frame
from r2s2r_cli.errors import HardwareError
from r2s2r_cli.stages.record.writer import Writer
from schemas.config import RecordSettings

_IDLE_S = 0.004
"""Between two looks for a frame: an eighth of the time between frames."""
_PNG_LEVEL = 1
WAITED_S = 60.0
"""A robot in lock-step waits for its camera, so that one on a busy machine is slow and not gone, for so long."""
LATE_S = 0.06
"""A picture is stamped when it comes, this much after its exposure at most (tick, transfer): stamped earlier than that
in a run it may show the robot where it lay before, and a tracker that begins there finds it nowhere."""


class Pictures:
    """Frames of one run into its `camera` stream, until the context ends.

    feed: frames as they come. stamp: from a frame to its time in the run [s]. waits: a robot in lock-step, whose time
    does not go on while the camera is slow. since: frames stamped before this are not of the run [s]. Counts:
    `written`, `lost` (gaps in the camera's own count), `repeated`.
    """

    def __init__(
        self, feed: CameraFeed, writer: Writer, stream: str, settings: RecordSettings, stamp: Callable[[Frame], float],
        *, waits: bool = False, since: float = 0.0,
    ) -> None:  # fmt: skip
        self._waits, self._since = waits, since
        self._gone_s = max(settings.camera_gone_s, WAITED_S) if waits else settings.camera_gone_s
        self._feed, self._writer, self._stream, self._settings, self._stamp = feed, writer, stream, settings, stamp
        self._ended = threading.Event()
        self._error: BaseException | None = None
        self._last_number: int | None = None
        self._last_seen = time.monotonic()
        self._last_t = -np.inf
        self.written = 0
        self.lost = 0
        self._repeated_before = 0
        self._thread = threading.Thread(target=self._work, name="record-camera", daemon=True)

    @property
    def doubt(self) -> str:
        """Why the motors should be held for now, "" nothing: no frame for longer than camera_hold_s."""
        late = not self._waits and self._feed.statistics.silent_s > self._settings.camera_hold_s
        return "the camera gave no frames" if late else ""

    def check(self) -> None:
        """Raises HardwareError where the camera is gone, or gives no frames any more."""
        if self._error is not None:
            raise self._error
        silent = time.monotonic() - self._last_seen
        if silent > self._gone_s:
            raise HardwareError(
                "the camera gives no frames, the motors were stopped", where="--camera",
                expected=f"a frame every {1e3 / 30:.0f} ms", received=f"none for {silent:.1f} s",
                hint="r2s2r doctor camera",
            )  # fmt: skip

    @property
    def repeated(self) -> int:
        """Frames of this run whose depth was that of the one before to the last bit: no camera has so little noise."""
        return self._feed.statistics.repeated - self._repeated_before

    def __enter__(self) -> Self:
        self._feed.frames()  # what came before the run is not of it
        self._repeated_before = self._feed.statistics.repeated
        self._feed.hold(self._waits)  # encoding takes longer than simulating
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()
        self._feed.hold(False)
        if error is None and self._error is not None:
            raise self._error

    def _work(self) -> None:
        try:
            while True:
                last_look = self._ended.is_set()
                frames = self._feed.frames()
                for frame in frames:
                    self._write(frame)
                if last_look:
                    return
                if not frames:
                    self._ended.wait(_IDLE_S)
        except BaseException as error:
            self._error = error
            self._feed.hold(False)  # nobody takes frames any more

    def _write(self, frame: Frame) -> None:
        self._last_seen = time.monotonic()
        t = float(self._stamp(frame))
        if t < self._since or t <= self._last_t:
            return  # of the time before the run, or delivered twice
        if self._last_number is not None:
            self.lost += max(0, frame.number - self._last_number - 1)
        self._last_number, self._last_t = frame.number, t
        row = {
            "t": t, "t_device": frame.t_device, "source_frame": frame.number, "pair": self.written, "t_depth": t,
            "color": encode_color(frame.color, self._settings), "depth": encode_depth(frame.depth),
        }  # fmt: skip
        self._writer.put(self._stream, row)
        self.written += 1


def encode_color(color: np.ndarray, settings: RecordSettings) -> bytes:
    """RGB uint8 (v, u, 3) as JPEG or PNG."""
    import cv2

    if settings.color == "png":
        return _encoded(cv2.imencode(".png", color[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, _PNG_LEVEL]))
    return _encoded(cv2.imencode(".jpg", color[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality]))


def encode_depth(depth: np.ndarray) -> bytes:
    """Counts uint16 (v, u) as PNG, without loss."""
    import cv2

    return _encoded(cv2.imencode(".png", depth, [cv2.IMWRITE_PNG_COMPRESSION, _PNG_LEVEL]))


def _encoded(result: tuple[bool, np.ndarray]) -> bytes:
    good, data = result
    if not good:
        raise HardwareError("a picture cannot be encoded", where="--camera", expected="8-bit RGB and 16-bit depth",
                            received="another form", hint="r2s2r doctor camera")  # fmt: skip
    return data.tobytes()

"""Read a camera in a thread of its own: whoever controls the robot must not wait for pictures."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections import deque
from types import TracebackType
from typing import Self

import numpy as np

from r2s2r_cli.devices.camera import Camera, CameraError, FeedStatistics, Frame

READ_S = 0.2
"""How long one read may wait: the feed ends within this."""
KEPT = 90
"""Frames kept for the reader: 3 s at 30 Hz, 140 MB at 640 x 480. Older ones are thrown away and counted."""


HELD = 16
"""Frames kept while the camera waits: the reader takes them all at once, and the camera's patience is short."""


class Feed:
    """A `devices.camera.CameraFeed`: begins to read at once."""

    def __init__(self, camera: Camera, *, kept: int = KEPT) -> None:
        """camera: open. Its owner closes it, after the feed."""
        self._camera, self._kept = camera, kept
        self._waiting: deque[Frame] = deque()
        self._lock = threading.Condition()
        self._holds = False
        self._statistics = FeedStatistics()
        self._error: CameraError | None = None
        self._last: Frame | None = None
        self._last_wall = time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera-feed", daemon=True)
        self._thread.start()

    @property
    def statistics(self) -> FeedStatistics:
        """What came so far."""
        with self._lock:
            return dataclasses.replace(self._statistics, silent_s=time.monotonic() - self._last_wall)

    def frames(self) -> list[Frame]:
        """What has come since the last call, in order; never waits. Raises CameraError once the camera is gone."""
        with self._lock:
            frames = list(self._waiting)
            self._waiting.clear()
            self._lock.notify_all()
            if not frames and self._error is not None:
                raise self._error
        return frames

    def hold(self, on: bool) -> None:
        """As `CameraFeed.hold`: no frame is read while there is no room for it."""
        with self._lock:
            self._holds = on
            self._lock.notify_all()

    def close(self) -> None:
        """Stop reading. The camera stays open."""
        self._ended.set()
        self.hold(False)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=READ_S + 5.0)

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                frame = self._camera.read(READ_S)
            except CameraError as error:
                with self._lock:
                    self._error = error
                return
            if frame is not None:
                self._take(frame)

    def _take(self, frame: Frame) -> None:
        last, wall = self._last, time.monotonic()
        again = last is not None and np.array_equal(last.depth, frame.depth)
        with self._lock:
            self._lock.wait_for(lambda: not self._holds or len(self._waiting) < min(HELD, self._kept))
            s = self._statistics
            full = len(self._waiting) >= self._kept
            if full:
                self._waiting.popleft()
            self._waiting.append(frame)
            self._statistics = dataclasses.replace(
                s,
                received=s.received + 1,
                lost=s.lost + (max(frame.number - last.number - 1, 0) if last is not None else 0),
                repeated=s.repeated + again,
                overrun=s.overrun + full,
                late_s=max(s.late_s, wall - self._last_wall) if last is not None else 0.0,
            )
            self._last, self._last_wall = frame, wall

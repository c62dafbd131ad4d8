"""A run's encoded pictures as the tracker's frames: decoded ahead in a thread, never more than a few at once."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame

AHEAD = 4
"""Frames decoded before they are asked for: 6 MB, and enough to bridge a slow one."""
_LOOK_S = 0.1
"""How soon the thread notices that nobody wants its frames any more."""


class Encoded(Protocol):
    """Encoded pictures by their number; reading is safe from a thread."""

    def __len__(self) -> int:
        """How many."""

    def __getitem__(self, index: int) -> bytes:
        """PNG or JPEG."""


@dataclass(frozen=True)
class DecodedFrames:
    """The FrameSource of a run.

    lens, depth_scale: see FrameSource. t: times of the frames [s], (frame,). color: a picture a frame. depth: pictures
    of which frame k has number pair[k], none where that is below 0; pair int64 (frame,). X_WC: pose of the camera that
    the recording states, (4, 4). where: name of the run's camera in messages.
    """

    lens: Intrinsics
    depth_scale: float
    t: np.ndarray
    color: Encoded
    depth: Encoded
    pair: np.ndarray
    X_WC: np.ndarray | None = None
    where: str = "camera"

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[ImageFrame]:
        """All frames in order. Raises InputError as `frame` does."""
        ready: queue.Queue[ImageFrame | BaseException | None] = queue.Queue(AHEAD)
        unwanted = threading.Event()
        thread = threading.Thread(target=self._work, args=(ready, unwanted), name="estimate-frames", daemon=True)
        thread.start()
        try:
            while (item := ready.get()) is not None:
                if isinstance(item, BaseException):
                    raise item
                yield item
        finally:
            unwanted.set()
            thread.join()

    def frame(self, index: int) -> ImageFrame:
        """One frame; a picture that cannot be decoded is None, as if it were missing.

        Raises InputError for a picture of another size or kind than the recording says.
        """
        depth = int(self.pair[index])
        return ImageFrame(
            index=index,
            t=float(self.t[index]),
            color=self._decoded(self.color, index, deep=False),
            depth=self._decoded(self.depth, depth, deep=True) if 0 <= depth < len(self.depth) else None,
        )

    def color_of(self, index: int) -> np.ndarray | None:
        """The colour picture of a frame alone, RGB uint8 (v, u, 3), None where it cannot be decoded; as `frame`."""
        return self._decoded(self.color, index, deep=False)

    def _work(self, ready: queue.Queue[ImageFrame | BaseException | None], unwanted: threading.Event) -> None:
        def put(item: ImageFrame | BaseException | None) -> bool:
            while not unwanted.is_set():
                try:
                    ready.put(item, timeout=_LOOK_S)
                except queue.Full:
                    continue
                return True
            return False

        try:
            for index in range(len(self)):
                if not put(self.frame(index)):
                    return
        except BaseException as error:
            put(error)
            return
        put(None)

    def _decoded(self, pictures: Encoded, index: int, *, deep: bool) -> np.ndarray | None:
        import cv2

        data = np.frombuffer(pictures[index], np.uint8)
        try:
            mode = cv2.IMREAD_UNCHANGED if deep else cv2.IMREAD_COLOR
            image = cv2.imdecode(data, mode) if len(data) else None
        except cv2.error:
            image = None
        if image is None:
            return None
        name, size = ("depth", "16-bit grey") if deep else ("colour", "8-bit RGB")
        good = image.dtype == np.uint16 and image.ndim == 2 if deep else image.dtype == np.uint8
        if not good or image.shape[:2] != (self.lens.height, self.lens.width):
            raise InputError(
                f"{name} picture {index} is not what the recording says",
                where=f"{self.where}/{'depth' if deep else 'color'}",
                expected=f"{size}, {self.lens.width} x {self.lens.height} px",
                received=f"{image.dtype}, {image.ndim} axes, {image.shape[1]} x {image.shape[0]} px",
                hint="r2s2r inspect 10-record.h5   # swapped colour and depth, or depth not registered to colour?",
            )
        return np.asarray(image) if deep else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)

"""Frames of a run with something wrong: what cameras, cables and people do to recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.frames import FrameSource, ImageFrame

Change = Callable[[ImageFrame], ImageFrame]


@dataclass(frozen=True)
class Spoiled:
    """A FrameSource whose frames go through `change`; rows: those that are left, default all."""

    of: FrameSource
    change: Change = lambda frame: frame
    rows: np.ndarray | None = None
    lens_: Intrinsics | None = None
    scale: float = 1.0

    @property
    def lens(self) -> Intrinsics:
        """Of the source, or what the recording says instead."""
        return self.lens_ or self.of.lens

    @property
    def depth_scale(self) -> float:
        """Wrong by `scale`."""
        return self.of.depth_scale * self.scale

    @property
    def t(self) -> np.ndarray:
        """Of the frames that are left."""
        return self.of.t if self.rows is None else self.of.t[self.rows]

    @property
    def X_WC(self) -> np.ndarray | None:
        """Of the source."""
        return self.of.X_WC

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[ImageFrame]:
        return (self.frame(k) for k in range(len(self)))

    def frame(self, index: int) -> ImageFrame:
        """One frame, spoiled."""
        row = index if self.rows is None else int(self.rows[index])
        return replace(self.change(self.of.frame(row)), index=index)


def during(start: float, stop: float, change: Change) -> Change:
    """The change in a part of the run only [s]."""
    return lambda frame: change(frame) if start <= frame.t < stop else frame


def black(frame: ImageFrame) -> ImageFrame:
    """The lens is covered: no light, no depth."""
    assert frame.color is not None
    assert frame.depth is not None
    return replace(frame, color=np.zeros_like(frame.color), depth=np.zeros_like(frame.depth))


def no_depth(frame: ImageFrame) -> ImageFrame:
    """The depth picture never came."""
    return replace(frame, depth=None)


def no_picture(frame: ImageFrame) -> ImageFrame:
    """Neither did."""
    return replace(frame, depth=None, color=None)


def saturated(frame: ImageFrame) -> ImageFrame:
    """Exposed far too long: every colour goes to white."""
    assert frame.color is not None
    return replace(frame, color=np.clip(4 * frame.color.astype(np.int32) + 120, 0, 255).astype(np.uint8))


def swapped(frame: ImageFrame) -> ImageFrame:
    """Colour is what depth looks like, and depth what colour does, each in the type of the other."""
    assert frame.color is not None
    assert frame.depth is not None
    grey = (frame.depth >> 5).astype(np.uint8)
    return replace(
        frame, color=np.repeat(grey[:, :, None], 3, axis=2), depth=frame.color.mean(axis=2).astype(np.uint16)
    )


def bgr(frame: ImageFrame) -> ImageFrame:
    """Red and blue are swapped."""
    assert frame.color is not None
    return replace(frame, color=frame.color[:, :, ::-1])


def empty(frame: ImageFrame) -> ImageFrame:
    """The robot is not there: floor only, from a corner of the picture."""
    assert frame.color is not None
    assert frame.depth is not None
    color, depth = frame.color[:100, :100], frame.depth[:100, :100]
    v, u = frame.depth.shape
    times = (-(-v // 100), -(-u // 100))
    return replace(frame, color=np.tile(color, (*times, 1))[:v, :u], depth=np.tile(depth, times)[:v, :u])

"""The pixels about one cap, and what each can say: of its colour, hidden by something nearer, of known depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NEARER_SD, NEARER_M = 4.0, 0.005
"""A depth in front of where the cap would be by this many standard deviations and this much more is another thing."""
_MAJORITY = 0.4


@dataclass(frozen=True)
class Patch:
    """A rectangle of the picture. All arrays (v, u).

    x, y: slopes of the rays of colour. colored: of the cap's colour. known: depth is known; z: depth [m], 0 where
    not. zx, zy: slopes of the rays of depth, which may lie beside colour.
    color: RGB (v, u, 3). u0, v0: its first column and row.
    """

    x: np.ndarray
    y: np.ndarray
    colored: np.ndarray
    known: np.ndarray
    z: np.ndarray
    zx: np.ndarray
    zy: np.ndarray
    color: np.ndarray
    u0: int
    v0: int

    def part(self, rows: slice, columns: slice) -> Patch | None:
        """A part of it, from `start` to `stop`, both given; None where it is smaller than three pixels either way."""
        area = (rows, columns)
        if min(self.x[area].shape) < 3:
            return None
        return Patch(
            self.x[area], self.y[area], self.colored[area], self.known[area], self.z[area], self.zx[area],
            self.zy[area], self.color[area], self.u0 + columns.start, self.v0 + rows.start,
        )  # fmt: skip


def in_front(patch: Patch, z_cap: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Pixels where something stands before the cap, with one pixel about them, bool.

    z_cap: depth [m] of the cap's near side, and about it that of its rim. sd: of depth there [m]. A pixel of unknown
    depth follows the majority about it: edges are where depths are missing.
    """
    import cv2

    near = patch.known & (patch.z < z_cap - NEARER_SD * sd - NEARER_M) & ~patch.colored
    if not near.any():
        return near
    count = cv2.boxFilter(near.astype(np.float32), -1, (5, 5), normalize=False, borderType=cv2.BORDER_REFLECT)
    known = cv2.boxFilter(patch.known.astype(np.float32), -1, (5, 5), normalize=False, borderType=cv2.BORDER_REFLECT)
    thing = (count > _MAJORITY * np.maximum(known, 1.0)) & (near | ~patch.known)
    return grown(thing, 1)


def grown(pixels: np.ndarray, by: int) -> np.ndarray:
    """Pixels with those up to `by` beside them."""
    import cv2

    size = 2 * by + 1
    return np.asarray(cv2.dilate(pixels.astype(np.uint8), np.ones((size, size), np.uint8)) > 0)

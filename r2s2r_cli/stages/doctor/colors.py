"""Colour ranges of the rods: measured from boxes or clicks, and what a range finds in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from schemas.robot import HsvRange

CLICK_PX = 5
"""A click stands for the square of 11 x 11 pixels about it, of which those like its middle count."""
HUE_LEAST = 6.0
"""Half width of a measured range at least; light and shadow shift hue by a few counts."""
SATURATION_SPARE, VALUE_SHARE = 30.0, 0.6
"""A measured minimum lies below what was seen by this."""
PATCH_PX = 8
"""A smaller connected patch is noise."""
_LIKE_HUE = 12.0
_LEAST_PIXELS = 40
"""Over all pictures that are looked at (five)."""
_LEAST_SATURATION = 50.0


@dataclass(frozen=True)
class Box:
    """Pixels u0 <= u < u1, v0 <= v < v1 of a picture, which hold a cap of `rod`. click: its middle is on the cap."""

    rod: str
    u0: int
    v0: int
    u1: int
    v1: int
    click: bool = False

    @classmethod
    def clicked(cls, rod: str, u: int, v: int) -> Box:
        """The square about a click."""
        return cls(rod, u - CLICK_PX, v - CLICK_PX, u + CLICK_PX + 1, v + CLICK_PX + 1, click=True)

    @property
    def area(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(max(self.v0, 0), max(self.v1, 0)), slice(max(self.u0, 0), max(self.u1, 0))


def hsv_of(color: np.ndarray) -> np.ndarray:
    """Hue 0 .. 180, saturation and value 0 .. 255 of an RGB picture, as OpenCV has them."""
    import cv2

    return np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2HSV))


def in_range(hsv: np.ndarray, wanted: HsvRange) -> np.ndarray:
    """Pixels (v, u) in a range; where its low hue is above the high one it wraps round red."""
    hue = hsv[..., 0].astype(float)
    low, high = wanted.hue
    inside = (hue >= low) & (hue <= high) if low <= high else (hue >= low) | (hue <= high)
    return inside & (hsv[..., 1] >= wanted.saturation_min) & (hsv[..., 2] >= wanted.value_min)


def measure_range(pictures: Sequence[np.ndarray], boxes: Sequence[Box], rod: str) -> HsvRange:
    """The range of a rod from HSV pictures and the boxes on it. Raises InputError for a box without colour."""
    taken = []
    for box in boxes:
        if box.rod == rod:
            found = np.concatenate([_colored(hsv[box.area], box) for hsv in pictures])
            if len(found) < _LEAST_PIXELS:
                raise InputError(
                    f"there is no colour to be seen where rod {rod} was marked",
                    where=f"u {box.u0} .. {box.u1}, v {box.v0} .. {box.v1}",
                    expected=f"{_LEAST_PIXELS} coloured pixels (saturation {_LEAST_SATURATION:g} and more)",
                    received=str(len(found)),
                    hint="r2s2r doctor camera --preview see.html   # what the camera sees; takes clicks on the caps",
                )  # fmt: skip
            taken.append(found)
    pixels = np.concatenate(taken)
    angle = pixels[:, 0] * (np.pi / 90.0)
    middle = float(np.arctan2(np.median(np.sin(angle)), np.median(np.cos(angle))) * 90.0 / np.pi) % 180.0
    off = np.abs(_apart(pixels[:, 0], middle))
    half = max(float(np.percentile(off, 98)) + 2.0, HUE_LEAST)
    low, high = (middle - half) % 180.0, (middle + half) % 180.0
    saturation = float(np.percentile(pixels[:, 1], 5)) - SATURATION_SPARE
    value = VALUE_SHARE * float(np.percentile(pixels[:, 2], 5))
    return HsvRange(
        rod=rod, hue=(float(round(low)), float(round(high))), saturation_min=float(max(round(saturation), 40)),
        value_min=float(max(round(value), 15)),
    )  # fmt: skip


def overlapping(ranges: Sequence[HsvRange]) -> list[tuple[str, str]]:
    """Pairs of rods whose hues overlap: their caps cannot be told apart."""
    found = []
    for i, one in enumerate(ranges):
        for other in ranges[i + 1 :]:
            ends = [(r.hue[0], (r.hue[1] - r.hue[0]) % 180.0) for r in (one, other)]
            (a, wide), (b, broad) = ends
            if (b - a) % 180.0 <= wide or (a - b) % 180.0 <= broad:
                found.append((one.rod, other.rod))
    return found


def patches(mask: np.ndarray) -> int:
    """Connected patches of PATCH_PX pixels and more."""
    import cv2

    _, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return int((stats[1:, cv2.CC_STAT_AREA] >= PATCH_PX).sum())


def _colored(hsv: np.ndarray, box: Box) -> np.ndarray:
    """Pixels of the cap in its box, (n, 3): for a click those like its middle, else those of the commonest colour."""
    pixels = hsv.reshape(-1, 3).astype(float)
    if not len(pixels):
        return pixels
    if box.click:
        core = hsv[hsv.shape[0] // 2 - 1 : hsv.shape[0] // 2 + 2, hsv.shape[1] // 2 - 1 : hsv.shape[1] // 2 + 2]
        hue, saturation = _peak(core.reshape(-1, 3).astype(float)), float(np.median(core[..., 1]))
    else:
        strong = pixels[pixels[:, 1] >= max(_LEAST_SATURATION, 0.6 * np.percentile(pixels[:, 1], 95))]
        if not len(strong):
            return strong
        hue, saturation = _peak(strong), float(np.median(strong[:, 1]))
    like = (np.abs(_apart(pixels[:, 0], hue)) <= _LIKE_HUE) & (pixels[:, 1] >= max(0.5 * saturation, _LEAST_SATURATION))
    return np.asarray(pixels[like])


def _peak(pixels: np.ndarray) -> float:
    """The hue about which most pixels lie, each counted by its saturation."""
    angle = pixels[:, 0] * (np.pi / 90.0)
    weight = pixels[:, 1] + 1e-9
    return float(np.arctan2((weight * np.sin(angle)).sum(), (weight * np.cos(angle)).sum()) * 90.0 / np.pi) % 180.0


def _apart(hue: np.ndarray, middle: float) -> np.ndarray:
    """Signed difference of hues, -90 .. 90."""
    return np.asarray((hue - middle + 90.0) % 180.0 - 90.0)

"""Which pixels have the colour of a rod's caps: the HSV ranges of `robot.toml`, red round the hue wrap too."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.errors import InputError
from schemas.robot import HsvRange, Robot

BLANK_SD = 2.0
"""A picture whose brightness varies by less [counts of 0 .. 255] shows nothing: lens cap, no light, white-out."""


def ranges_of(robot: Robot) -> tuple[HsvRange, ...]:
    """The colour range of every rod in order. Raises InputError for a rod without one: its caps cannot be found."""
    ranges = {color.rod: color for color in robot.colors}
    missing = [rod.name for rod in robot.rods if rod.name not in ranges]
    if missing:
        raise InputError(
            f"robot.toml has no colour for rod {missing[0]}",
            where="robot.toml [[colors]]",
            expected="a colour range for each rod, to find its caps in the pictures",
            received=f"none for {', '.join(missing)}",
            hint="r2s2r doctor camera --camera replay:10-record.h5 --preview see.png",
        )
    return tuple(ranges[rod.name] for rod in robot.rods)


def hsv_of(color: np.ndarray) -> np.ndarray:
    """Hue 0 .. 180, saturation and value 0 .. 255 of an RGB picture, as OpenCV has them, uint8 (v, u, 3)."""
    import cv2

    return np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2HSV))


def mask(hsv: np.ndarray, wanted: HsvRange) -> np.ndarray:
    """Pixels in a range, bool (v, u); where its low hue is above the high one it wraps round red."""
    import cv2

    def part(low: float, high: float) -> np.ndarray:
        floor = (np.ceil(low), np.ceil(wanted.saturation_min), np.ceil(wanted.value_min))
        return np.asarray(cv2.inRange(hsv, floor, (np.floor(high), 255.0, 255.0)))

    low, high = wanted.hue
    found = part(low, high) if low <= high else cv2.bitwise_or(part(low, 180.0), part(0.0, high))
    return np.asarray(found).view(bool) if found.dtype == bool else np.asarray(found > 0)


def blank(color: np.ndarray) -> bool:
    """Whether a picture shows nothing: all of it is one brightness."""
    return bool(np.std(color[::8, ::8].astype(float).mean(axis=-1)) < BLANK_SD)

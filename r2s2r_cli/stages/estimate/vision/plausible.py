"""Whether pictures, depth unit and focal length can belong to this robot: are balls as large, rods as long as given?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.vision.colors import hsv_of, mask, ranges_of
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from schemas.robot import Robot

SIZE_RATIO = 1.35
"""Discs whose radius differs from what their depth says by more: depth unit or focal length are wrong. A disc
that is half hidden has 0.7 of its radius, so the upper quartile of all is taken."""
LENGTH_WARNS, LENGTH_FAILS = 0.02, 0.06
"""Rods whose length is wrong by more than this share."""
_PATCH_PX = 8
_LEAST = 3


def check_sizes(frames: Sequence[ImageFrame], robot: Robot, lens: Intrinsics, scale: float) -> None:
    """Raises InputError where caps look far larger or smaller than their depths say."""
    ratios = [ratio for frame in frames for ratio in _ratios(frame, robot, lens, scale)]
    if len(ratios) < _LEAST:
        return
    ratio = float(np.percentile(ratios, 75))
    if not 1 / SIZE_RATIO < ratio < SIZE_RATIO:
        raise InputError(
            "the caps do not look as large as their depth says",
            where=f"{len(frames)} frames; depth_scale {scale:g} m, fx {lens.fx:g}",
            expected="discs of the radius of the caps in robot.toml",
            received=f"{ratio:.2f} times that; with this focal length depth_scale would be {scale / ratio:.2g} m",
            hint="r2s2r import FOLDER --depth-scale 0.00025",
        )


def check_lengths(lengths: Sequence[float]) -> str | None:
    """A warning where rods are not as long as they should be. Raises InputError where they are not at all.

    lengths: distances of a rod's two caps over the length in `robot.toml`.
    """
    if len(lengths) < _LEAST:
        return None
    off = float(np.median(lengths)) - 1.0
    way = "longer" if off > 0 else "shorter"
    spread = 1.4826 * float(np.median(np.abs(np.array(lengths) - 1.0 - off))) / np.sqrt(len(lengths))
    if abs(off) > LENGTH_FAILS + 3 * spread:
        raise InputError(
            f"the rods look {100 * abs(off):.1f} % {way} than they are",
            where=f"{len(lengths)} pairs of caps",
            expected=f"the lengths of robot.toml, to {100 * LENGTH_FAILS:.0f} %",
            received=f"{1 + off:.3f} of them: focal length, depth unit or robot.toml are wrong",
            hint="r2s2r doctor camera --camera realsense",
        )
    if abs(off) > LENGTH_WARNS + 3 * spread:
        return f"rods look {100 * abs(off):.1f} % {way} than in robot.toml: focal length or depth unit are a little off"
    return None


def _ratios(frame: ImageFrame, robot: Robot, lens: Intrinsics, scale: float) -> list[float]:
    """Radius of the discs in a frame over that which their depth says, the two largest a colour."""
    import cv2

    if frame.color is None or frame.depth is None:
        return []
    hsv, found = hsv_of(frame.color), []
    for rod, wanted in zip(robot.rods, ranges_of(robot), strict=True):
        count, label, stats, _ = cv2.connectedComponentsWithStats(mask(hsv, wanted).astype(np.uint8), connectivity=8)
        order = 1 + np.argsort(-stats[1:, cv2.CC_STAT_AREA])[:2]
        for i in order[: count - 1]:
            left, top, width, height, area = stats[i]
            box = (slice(top, top + height), slice(left, left + width))
            depth = frame.depth[box][label[box] == i]
            if area < _PATCH_PX or not (depth > 0).any():
                continue
            z = float(np.median(depth[depth > 0])) * scale + 0.7 * rod.cap_radius_m
            found.append(float(np.sqrt(area / np.pi)) * z / (np.sqrt(lens.fx * lens.fy) * rod.cap_radius_m))
    return found

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
LENGTH_WARNS, LENGTH_FAILS = 0.01, 0.02
"""Rods whose length is wrong by more than this share."""
HINT = "r2s2r doctor camera --camera replay:10-record.h5"
_LENGTH_SD = 0.015
"""Lengths that are known better than this, as a share, are asked first: rods that lie across the line of sight."""
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
            received=f"{ratio:.2f} times that; with this focal length {_unit(scale / ratio, 2)} would fit",
            hint=HINT,
        )


def check_lengths(lengths: Sequence[tuple[float, float]], lens: Intrinsics, scale: float) -> str | None:
    """A warning where rods are not quite as long as they should be. Raises InputError where they are not at all.

    lengths: distances of a rod's two caps over the length in `robot.toml`, each with its standard deviation. Rods are
    rigid, so many of them know the scale of the pictures far better than one does.
    """
    found = np.array(lengths).reshape(-1, 2)
    if (found[:, 1] < _LENGTH_SD).sum() >= _LEAST:
        found = found[found[:, 1] < _LENGTH_SD]
    if len(found) < _LEAST:
        return None
    ratio = float(np.median(found[:, 0]))
    off, way = abs(ratio - 1.0), "longer" if ratio > 1 else "shorter"
    spread = 1.4826 * float(np.median(np.abs(found[:, 0] - ratio))) / np.sqrt(len(found))
    cure = f"{_unit(scale / ratio, 4)} or fx {lens.fx * ratio:.1f} would fit"
    if off > LENGTH_FAILS + 3 * spread:
        raise InputError(
            f"the rods look {100 * off:.1f} % {way} than they are",
            where=f"{len(found)} pairs of caps; depth_scale {scale:g} m, fx {lens.fx:g}",
            expected=f"the lengths of robot.toml, to {100 * LENGTH_FAILS:.1f} %",
            received=f"{ratio:.3f} of them; {cure}",
            hint=HINT,
        )
    if off > LENGTH_WARNS + 3 * spread:
        return f"the rods look {100 * off:.1f} % {way} than in robot.toml; {cure}"
    return None


def _unit(scale: float, digits: int) -> str:
    """A unit of depth as messages and as the config.json of an imported folder have it."""
    return f"depth_scale {scale:.{digits}g} m ({1 / scale:.0f} counts a metre in the config.json of a folder)"


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

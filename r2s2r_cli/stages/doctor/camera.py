"""Everything that `doctor camera` says, from frames and the robot's colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.camera import FeedStatistics, Frame, Intrinsics
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.doctor.colors import Box, hsv_of, in_range, measure_range, overlapping, patches
from r2s2r_cli.stages.estimate.vision.plane import MIN_SHARE, Ground, find_ground, points_C
from schemas.results_camera import CameraGround, CameraResult, CameraRod
from schemas.robot import HsvRange, Robot

RAISED_M = 0.008
"""What is lower than this lies on the ground: a distractor, or noise."""
HOLE_PX = 7
"""Holes in the depth up to this wide are what is around them; a cap is 14 pixels wide from 1.4 m."""
_UNKNOWN_SHARE = 0.3
_RATE_SHARE = 0.9


@dataclass(frozen=True)
class Looked:
    """What was found, and what a picture of it needs: the middle frame, heights over the ground [m] (v, u), NaN where
    depth is unknown, and the pixels of every rod."""

    result: CameraResult
    frame: Frame
    height: np.ndarray | None
    masks: dict[str, np.ndarray]
    remarks: tuple[str, ...]


def look(
    frames: Sequence[Frame], *, name: str, lens: Intrinsics, depth_scale: float, rate_hz: float, robot: Robot | None,
    statistics: FeedStatistics, boxes: Sequence[Box] = (),
) -> Looked:  # fmt: skip
    """Judge a camera by its frames (at least one). boxes: of the rods whose colours are to be measured anew.

    Raises UsageError for a box of a rod that the robot has not, InputError for one without colour.
    """
    rods = [rod.name for rod in robot.rods] if robot else list(dict.fromkeys(box.rod for box in boxes))
    for box in boxes:
        if box.rod not in rods:
            raise UsageError("there is no such rod", where="--box or --click", expected=" | ".join(rods),
                             received=box.rod, hint=f"--click {rods[0]}:320,240")  # fmt: skip
    middle = frames[len(frames) // 2]
    points = points_C(middle.depth, lens, depth_scale)
    ground = find_ground(points)
    pictures = [hsv_of(frame.color) for frame in frames[:: max(len(frames) // 5, 1)]]
    ranges = {color.rod: color for color in robot.colors} if robot else {}
    marked = {box.rod for box in boxes}
    ranges |= {rod: measure_range(pictures, boxes, rod) for rod in rods if rod in marked}
    raised, height = np.ones(middle.depth.shape, dtype=bool), None
    if ground is not None:
        height = ground.height(points)
        raised = ~_low(height, max(RAISED_M, 3 * ground.noise_sd))
    hsv = hsv_of(middle.color)
    masks = {rod: in_range(hsv, ranges[rod]) for rod in rods if rod in ranges}
    seen = tuple(_rod(rod, ranges.get(rod), rod in marked, masks.get(rod), raised, middle.depth > 0) for rod in rods)
    rate, offset, spread = _pace(frames)
    result = CameraResult(
        name=name, width=lens.width, height=lens.height, fx=lens.fx, fy=lens.fy, cx=lens.cx, cy=lens.cy,
        distortion=lens.distortion, depth_scale_m=depth_scale, frames=len(frames), lost=statistics.lost,
        repeated=statistics.repeated, rate_stated_hz=rate_hz, rate_hz=rate,
        clock_offset_s=offset, clock_spread_s=spread,
        depth_unknown=float(np.mean([(frame.depth == 0).mean() for frame in frames])),
        ground=None if ground is None else _ground(ground), rods=seen,
    )  # fmt: skip
    shown = {rod: mask & raised for rod, mask in masks.items()}
    return Looked(result, middle, height, shown, tuple(_remarks(result, list(ranges.values()))))


def _low(height: np.ndarray, limit: float) -> np.ndarray:
    """Pixels that lie on the ground: lower than the limit, or unknown in the midst of such."""
    import cv2

    low = height < limit
    closed = cv2.morphologyEx(low.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((HOLE_PX, HOLE_PX), np.uint8))
    return np.asarray(low | ((closed > 0) & ~np.isfinite(height)))


def _pace(frames: Sequence[Frame]) -> tuple[float, float, float]:
    """Rate by the camera's clock [Hz]; host's clock minus the camera's, the least, and most minus least [s]."""
    t = np.array([frame.t_device for frame in frames])
    number = np.array([frame.number for frame in frames])
    delay = np.array([frame.t_host for frame in frames]) - t
    span = float(t[-1] - t[0])
    rate = float(number[-1] - number[0]) / span if span > 0 else 0.0
    return rate, float(delay.min()), float(np.ptp(delay))


def _ground(ground: Ground) -> CameraGround:
    x, y, z = (float(value) for value in ground.normal_C)
    return CameraGround(distance_m=ground.distance, tilt_rad=ground.tilt, normal_C=(x, y, z),
                        inlier_share=ground.share, noise_sd_m=ground.noise_sd)  # fmt: skip


def _rod(
    rod: str, wanted: HsvRange | None, measured: bool, mask: np.ndarray | None, raised: np.ndarray, known: np.ndarray
) -> CameraRod:
    if mask is None:
        return CameraRod(rod=rod, range=None, measured=False, pixels=0, patches=0, with_depth=0.0, distractors=0)
    cap = mask & raised
    pixels = int(cap.sum())
    return CameraRod(
        rod=rod, range=wanted, measured=measured, pixels=pixels, patches=patches(cap),
        with_depth=float((cap & known).sum() / pixels) if pixels else 0.0, distractors=int((mask & ~raised).sum()),
    )  # fmt: skip


def _remarks(result: CameraResult, ranges: Sequence[HsvRange]) -> list[str]:
    """What a person should look into, in words."""
    found = []
    if result.ground is None:
        found.append("no ground is seen: no plane goes through the depths")
    elif result.ground.inlier_share < MIN_SHARE:
        found.append(
            f"the largest plane holds {result.ground.inlier_share:.0%} of the pixels: it need not be the ground"
        )
    if result.depth_unknown > _UNKNOWN_SHARE:
        found.append(f"{result.depth_unknown:.0%} of the pixels have no depth: too close, too far, too dark or glossy")
    if result.frames > 1 and result.rate_hz < _RATE_SHARE * result.rate_stated_hz:
        found.append(f"{result.rate_hz:.1f} frames a second where {result.rate_stated_hz:.1f} are promised")
    if result.repeated > result.frames // 4:
        found.append(f"{result.repeated} of {result.frames} frames repeat the one before: a frozen camera")
    for rod in result.rods:
        if rod.range is None:
            found.append(f"rod {rod.rod} has no colour range: mark its caps with --click {rod.rod}:U,V --save")
        elif rod.patches < 2:
            found.append(f"rod {rod.rod}: {rod.patches} of its 2 caps are seen; mark them with --click {rod.rod}:U,V")
        elif rod.patches > 2:
            found.append(f"rod {rod.rod}: {rod.patches} patches of its colour, there are 2 caps")
    found += [f"the colours of {one} and {other} overlap" for one, other in overlapping(ranges)]
    return found

"""The camera of a recording: its geometry, and which depth frame belongs to which colour frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.artifact import Blobs
from r2s2r_cli.checks.base import AGAIN, Found, check, number, worst
from r2s2r_cli.checks.subjects import Run
from schemas.recording import ROTATION_TOLERANCE

DEPTH_SCALE_M = (1e-5, 1e-2)
"""Real cameras have 1/1000, 1/4000 or 1/5000 m a count; 65535 counts must reach 0.65 m and may not reach 655 m."""
PAIR_GAP_S = 0.1
"""Colour and depth of one instant come within a frame or two at 30 Hz."""
LAST_ROW = 1e-6
"""0 0 0 1, to rounding."""
_KINDS = ("recording",)


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="every colour frame names a depth frame that is there, or -1",
    why="the wrong depth under a colour is a cap in the wrong place",
    fix=AGAIN,
)
def depth_pairs_exist(run: Run) -> Iterator[Found]:
    """Pair numbers outside the depth frames."""
    pair = run.array("camera", "pair")
    if pair is None:
        return
    count = _depth_frames(run)
    bad = (pair < -1) | (pair >= count)
    if bad.any():
        yield Found(run.at("camera", "pair"), "a colour frame names a depth frame that is not there",
                    f"-1 (none) .. {count - 1}", worst(pair, bad.astype(float), ("colour frame",)))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="a colour frame and its depth frame are at most 0.1 s apart",
    why="a robot that moves is somewhere else by then",
    fix="look at the stamps in the source: colour and depth may have other clocks",
)
def depth_pairs_close(run: Run) -> Iterator[Found]:
    """Pairs far apart in time."""
    pair, t, t_depth = (run.array("camera", name) for name in ("pair", "t", "t_depth"))
    if pair is None or t is None or t_depth is None or not len(t_depth):
        return
    paired = (pair >= 0) & (pair < len(t_depth))
    gap = np.where(paired, np.abs(t - t_depth[np.clip(pair, 0, len(t_depth) - 1)]), 0.0)
    if (gap > PAIR_GAP_S).any():
        yield Found(run.at("camera", "pair"), "a colour frame and its depth frame are far apart in time",
                    f"at most {PAIR_GAP_S:g} s",
                    worst(gap, gap * (gap > PAIR_GAP_S), ("colour frame",), unit="s"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="one depth count is 0.01 mm to 10 mm",
    why="counts a metre (4000) in place of metres a count (1/4000) put the robot kilometres away",
    fix="give depth_scale in metres a count: 1/4000 = 0.00025 for a RealSense, 0.001 for millimetres",
)
def depth_scale_sensible(run: Run) -> Iterator[Found]:
    """A depth scale that no camera has."""
    scale = run.attribute("camera", "depth_scale")
    if scale is not None and not DEPTH_SCALE_M[0] <= scale <= DEPTH_SCALE_M[1]:
        yield Found(f"{run.at('camera')}@depth_scale", "the depth scale is none of a camera",
                    f"{DEPTH_SCALE_M[0]:g} .. {DEPTH_SCALE_M[1]:g} m a count", f"{number(scale)} m")  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="focal lengths are positive and the principal point lies in the image",
    why="every pixel is turned into a direction by these four numbers",
    fix="compare the intrinsics in the source with those of the camera at this image size",
)
def intrinsics_sensible(run: Run) -> Iterator[Found]:
    """Intrinsics of another image size, or none at all."""
    for focal in ("fx", "fy"):
        value = run.attribute("camera", focal)
        if value is not None and value <= 0:
            yield Found(f"{run.at('camera')}@{focal}", "a focal length is not positive", "above 0 px",
                        f"{number(value)} px")  # fmt: skip
    for centre, size in (("cx", "width"), ("cy", "height")):
        value, limit = run.attribute("camera", centre), run.attribute("camera", size)
        if value is not None and limit is not None and not 0 < value < limit:
            yield Found(f"{run.at('camera')}@{centre}", "the principal point lies outside the image",
                        f"0 .. {number(limit)} px", f"{number(value)} px")  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="the pose of the camera is a rotation and a translation",
    why="a matrix that scales, mirrors or is transposed distorts everything that was seen",
    fix="compare X_WC with its source: camera to world, translation in metres in the last column",
)
def camera_pose_is_rigid(run: Run) -> Iterator[Found]:
    """A pose matrix that is none."""
    X_WC = run.array("camera", "X_WC")
    if X_WC is None:
        return
    R = X_WC[:3, :3]
    error = float(np.abs(R.T @ R - np.eye(3)).max())
    if error > ROTATION_TOLERANCE:
        yield Found(run.at("camera", "X_WC"), "the pose of the camera is no rotation", "R^T R = 1",
                    f"off by {number(error)}")  # fmt: skip
    elif np.linalg.det(R) < 0:
        yield Found(run.at("camera", "X_WC"), "the pose of the camera mirrors", "determinant +1", "-1")
    if np.abs(X_WC[3] - (0, 0, 0, 1)).max() > LAST_ROW:
        yield Found(run.at("camera", "X_WC"), "the last row of the camera's pose is not 0 0 0 1", "0 0 0 1",
                    " ".join(number(x) for x in X_WC[3]))  # fmt: skip


def _depth_frames(run: Run) -> int:
    t = run.array("camera", "t_depth")
    if t is not None:
        return len(t)
    depth = run.streams["camera"].datasets.get("depth")
    return depth.count if isinstance(depth, Blobs) else 0

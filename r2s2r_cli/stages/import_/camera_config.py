"""`config.json` of the authors' folder: image size, intrinsics, depth scale, pose of the camera."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from r2s2r_cli.artifact import Scalar
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_.authors_json import number, parse_json
from r2s2r_cli.stages.import_.files import shown
from schemas.recording import ROTATION_TOLERANCE

HALF_PIXEL = 0.5
"""OpenCV and librealsense put the centre of the first pixel at 0, this project at 0.5."""
DEPTH_SCALES_M = (1e-5, 1e-2)
"""A depth count between 10 um and 10 mm: 65535 counts then reach from 0.7 m to 655 m."""


def camera_attributes(
    data: bytes | None, where: str, *, size: tuple[int, int], depth_scale: float | None, has_depth: bool
) -> tuple[dict[str, Scalar], np.ndarray | None]:
    """Attributes of the group `camera`, and the pose X_WC (4, 4) where the file has `cam_extr`.

    data: bytes of config.json, None where there is none. size: of the images [px]. depth_scale: [m] a count, from
    the user; it must agree with the file, and is needed where the file does not give it. Raises InputError.
    """
    attributes: dict[str, Scalar] = {"width": size[0], "height": size[1]}
    tree: dict[str, Any] = {} if data is None else parse_json(data, where, "the camera configuration")
    for key, pixels in (("im_w", size[0]), ("im_h", size[1])):
        if key in tree and number(tree[key], f"{where}: {key}") != pixels:
            raise InputError(
                "the camera configuration is of other images",
                where=f"{where}: {key}",
                expected=f"{pixels} px, as the images",
                received=shown(json.dumps(tree[key])),
                hint="put the configuration of this recording there",
            )
    if "cam_intr" in tree:
        K = _matrix(tree["cam_intr"], (3, 3), f"{where}: cam_intr")
        if not (K[0, 0] > 0 and K[1, 1] > 0 and abs(K[2, 2] - 1) < 1e-9 and K[1, 0] == K[2, 0] == K[2, 1] == 0):
            raise _bad_matrix(f"{where}: cam_intr", "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]", K)
        attributes |= {
            "fx": float(K[0, 0]),
            "fy": float(K[1, 1]),
            "cx": float(K[0, 2]) + HALF_PIXEL,
            "cy": float(K[1, 2]) + HALF_PIXEL,
        }
    if has_depth:
        attributes["depth_scale"] = _depth_scale(tree, where, depth_scale)
    return attributes, _pose(tree, where)


def check_depth_scale(depth_scale: float, where: str) -> float:
    """The user's depth scale [m a count], if it can be one. Raises InputError, e.g. for 4000 instead of 1/4000."""
    if DEPTH_SCALES_M[0] <= depth_scale <= DEPTH_SCALES_M[1]:
        return depth_scale
    inverse = f"{1 / depth_scale:g}" if depth_scale > 1 else "0.001"
    raise InputError(
        "the depth scale cannot be right",
        where=where,
        expected=f"metres per depth count, {DEPTH_SCALES_M[0]:g} .. {DEPTH_SCALES_M[1]:g}",
        received=f"{depth_scale:g}",
        hint=f"--depth-scale {inverse}",
    )


def _depth_scale(tree: dict[str, Any], where: str, given: float | None) -> float:
    stated: float | None = None
    if "depth_scale" in tree:
        counts = number(tree["depth_scale"], f"{where}: depth_scale")
        if not counts > 1:
            raise InputError(
                "the camera configuration's depth scale cannot be right",
                where=f"{where}: depth_scale",
                expected="counts per metre, 1000 or 4000",
                received=f"{counts:g}",
                hint="write the counts per metre: 1000 (D400 series) or 4000 (L515)",
            )
        stated = check_depth_scale(1.0 / counts, f"{where}: depth_scale")
    if given is None and stated is None:
        raise InputError(
            "the depth scale is not known",
            where=where,
            expected="depth_scale in config.json (counts per metre), or the option",
            received="neither",
            hint="--depth-scale 0.001 (1/1000 m, D400 series) or --depth-scale 0.00025 (1/4000 m, L515)",
        )
    if given is not None and stated is not None and abs(given / stated - 1) > 1e-6:
        raise InputError(
            "two depth scales disagree",
            where=f"{where}: depth_scale",
            expected=f"{stated:g} m a count, as config.json says",
            received=f"{given:g} from the option",
            hint="leave the option out, or correct config.json",
        )
    return stated if stated is not None else check_depth_scale(float(given or 0.0), "--depth-scale")


def _pose(tree: dict[str, Any], where: str) -> np.ndarray | None:
    """Camera-to-world matrix of `cam_extr`, checked to be rigid."""
    if "cam_extr" not in tree:
        return None
    X_WC = _matrix(tree["cam_extr"], (4, 4), f"{where}: cam_extr")
    R_WC = X_WC[:3, :3]
    rigid = np.abs(R_WC.T @ R_WC - np.eye(3)).max() < ROTATION_TOLERANCE and np.linalg.det(R_WC) > 0
    if not rigid or not np.array_equal(X_WC[3], [0, 0, 0, 1]):
        raise _bad_matrix(f"{where}: cam_extr", "a rotation and a translation in metres, last row 0 0 0 1", X_WC)
    return X_WC


def _matrix(value: object, shape: tuple[int, int], where: str) -> np.ndarray:
    rows = value if isinstance(value, list) else []
    good = len(rows) == shape[0] and all(isinstance(row, list) and len(row) == shape[1] for row in rows)
    if not good:
        raise InputError(
            "the camera configuration has a broken matrix",
            where=where,
            expected=f"{shape[0]} rows of {shape[1]} numbers",
            received=shown(json.dumps(value)),
            hint="write it row by row, as the camera's calibration gives it",
        )
    matrix = np.array([[number(cell, where) for cell in row] for row in rows])
    if not np.isfinite(matrix).all():
        raise _bad_matrix(where, "finite numbers", matrix)
    return matrix


def _bad_matrix(where: str, expected: str, matrix: np.ndarray) -> InputError:
    return InputError(
        "the camera configuration has a broken matrix",
        where=where,
        expected=expected,
        received=shown(json.dumps(matrix.tolist())),
        hint="copy it again from the camera's calibration",
    )

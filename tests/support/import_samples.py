"""Logs with planted truth: a rigid three-rod robot that glides over the ground, in closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from schemas.robot import Robot

ROD_M, CAP_RADIUS_M = 0.325, 0.0175
_CABLES = [(3, 5), (1, 3), (1, 5), (0, 2), (0, 4), (2, 4), (2, 5), (0, 3), (1, 4)]
SIDECAR = """\
robot = "sample"
source = "closed-form motion, made for a test"
nature = "kinematic sample"

[pid]
min_length_m = 0.095
range_m = 0.1
tolerance = 0.1
motor_speed = 0.8
winch_radius_m = 0.0035
"""


def sample_robot(rod_length_m: float = ROD_M, name: str = "sample") -> Robot:
    """Three rods, six actuated and three passive cables, nine sensors."""
    cap = {"name": "cap", "mass_kg": 0.01, "offset_m": 0.0, "shape": "point"}
    rods = [
        {"name": f"rod{i}", "length_m": rod_length_m, "radius_m": 0.0016, "cap_radius_m": CAP_RADIUS_M, "parts": [cap]}
        for i in range(3)
    ]
    cables = [
        {
            "caps": caps,
            "kind": "actuated" if i < 6 else "passive",
            "stiffness_n_per_m": 100.0,
            "damping_n_s_per_m": 1.0,
            "sites_m": ((0.0, 0.0, -0.16), (0.0, 0.0, 0.16)),
        }
        | ({} if i < 6 else {"rest_length_m": 0.165})
        for i, caps in enumerate(_CABLES)
    ]
    return Robot.model_validate(
        {
            "schema_version": 1,
            "name": name,
            "title": "sample",
            "attachment": "rod_end",
            "rods": rods,
            "cables": cables,
            "motors": [
                {"cable": k, "no_load_rad_per_s": 23.0, "speed": 0.8, "winch_radius_m": 0.0035} for k in range(6)
            ],
            "sensors": [{"cable": k} for k in range(9)],
            "pid": {
                "p": 6.0, "i": 0.01, "d": 0.5, "tolerance": 0.1, "min_length_m": 0.095, "range_m": 0.1,
                "rate_hz": 50.0, "step_timeout_s": 10.0,
            },
            "limits": {"cable_length_min_m": 0.05, "cable_length_max_m": 0.3, "cap_height_max_m": 0.4},
            "contact": {"friction": 0.5, "restitution": 0.0},
            "rest_caps_m": [tuple(p) for p in standing_caps().tolist()],
        }
    )  # fmt: skip


def standing_caps(height_m: float = 0.0) -> np.ndarray:
    """End caps [m] of the robot standing on its even caps, shape (6, 3); the ground lies at z = height."""
    angle = np.deg2rad(120.0) * np.arange(3)
    radius = 0.14
    top = np.sqrt(ROD_M**2 - (2 * radius * np.sin(np.deg2rad(75.0))) ** 2)
    even = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(3)], axis=1)
    odd = np.stack([radius * np.cos(angle + 2.618), radius * np.sin(angle + 2.618), np.full(3, top)], axis=1)
    caps = np.empty((6, 3))
    caps[0::2], caps[1::2] = even, odd
    # 150 degrees is 2.618 rad only to four digits: bring the rods to their length exactly.
    axis = caps[1::2] - caps[0::2]
    caps[1::2] = caps[0::2] + ROD_M * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    caps[:, 2] += CAP_RADIUS_M + height_m
    return caps


def glide(
    t: np.ndarray, *, speed_m_per_s: float = 0.05, turn_rad_per_s: float = 0.0, height_m: float = 0.0
) -> np.ndarray:
    """End caps [m], shape (frame, 6, 3): the standing robot moves along x and turns about z."""
    caps = standing_caps(height_m)
    angle = turn_rad_per_s * t
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    p_WE = np.tile(caps, (len(t), 1, 1))
    p_WE[:, :, :2] = np.einsum("tij,cj->tci", turn, caps[:, :2])
    p_WE[:, :, 0] += speed_m_per_s * t[:, None]
    return p_WE


def csv_text(
    t: np.ndarray,
    p_WE: np.ndarray,
    target: np.ndarray,
    control: np.ndarray | None = None,
    *,
    length: np.ndarray | None = None,
    unit: str = "m",
    header_unit: str | None = None,
) -> str:
    """A trajectory CSV; lengths are written in `unit`, and called `header_unit` (default: the truth)."""
    scale = {"m": 1.0, "dm": 10.0, "cm": 100.0, "mm": 1000.0}[unit]
    said = header_unit or unit
    names = ["t_s", *(f"cap{c}_{axis}_{said}" for c in range(p_WE.shape[1]) for axis in "xyz")]
    names += [f"target{k}" for k in range(target.shape[1])]
    blocks = [t[:, None], scale * p_WE.reshape(len(t), -1), target]
    if control is not None:
        names += [f"control{k}" for k in range(control.shape[1])]
        blocks.append(control)
    if length is not None:
        names += [f"length{j}_{said}" for j in range(length.shape[1])]
        blocks.append(scale * length)
    table = np.concatenate(blocks, axis=1)
    rows = [",".join(f"{value:.9g}" for value in row) for row in table]
    return "\n".join([",".join(names), *rows]) + "\n"


def steps(n_frames: int, vectors: list[list[float]]) -> np.ndarray:
    """Target vectors held for equal numbers of frames, shape (frame, cable)."""
    which = np.minimum(np.arange(n_frames) * len(vectors) // n_frames, len(vectors) - 1)
    return np.array(vectors, dtype=float)[which]


def small_csv() -> str:
    """Twelve good rows at 10 Hz with two target intervals: the base of the malformed cases."""
    t = np.arange(12) * 0.1
    target = steps(12, [[0.1, 0, 0.1, 0, 0, 0], [1, 0.1, 1, 0, 0, 0]])
    return csv_text(t, glide(t), target, np.zeros((12, 6)))


def frame_json(secs: float = 1676990000.0, **changes: Any) -> dict[str, Any]:
    """One frame as the authors' recorder writes it; `changes` replace top-level parts."""
    frame = {
        "header": {"secs": secs, "seq": 1},
        "info": {"min_length": 95, "RANGE": 100, "max_speed": 80, "tol": 0.1, "P": 6, "I": 0.01, "D": 0.5},
        "sensors": {str(j): {"capacitance": 15.5 + j, "length": 120.0 + j} for j in range(9)},
        "motors": {
            str(k): {
                "position": 0.5, "target": 1.0, "speed": -40.0, "done": False, "error": 0.1,
                "encoder_counts": 100 + k, "encoder_length": 11.0,
            }
            for k in range(6)
        },
        "imu": {
            "0": {"acceleromter": {"x": 0.0, "y": 0.0, "z": 1.0}, "gyroscope": {"x": 0.0, "y": 90.0, "z": 0.0}}
        },
        "mocap": {str(c): {"x": 100.0 * c, "y": 0.0, "z": 17.5} for c in range(5)} | {"5": None},
    }  # fmt: skip
    return frame | changes


def write_image(path: Path, *, depth: bool, size: tuple[int, int] = (8, 6), value: int = 1000) -> None:
    """A tiny PNG (or JPEG by its suffix): 16-bit grey for depth, else 8-bit colour. size: width, height."""
    import cv2

    path.parent.mkdir(parents=True, exist_ok=True)
    shape = (size[1], size[0])
    image = np.full(shape, value, np.uint16) if depth else np.full((*shape, 3), value % 256, np.uint8)
    assert cv2.imwrite(str(path), image)


CONFIG = {
    "id": "images", "im_w": 8, "im_h": 6, "depth_scale": 4000,
    "cam_intr": [[600.0, 0, 3.5], [0, 601.0, 2.5], [0, 0, 1]],
}  # fmt: skip


def write_authors_folder(root: Path, frames: list[dict[str, Any]], *, config: dict[str, Any] | None = None) -> Path:
    """A folder in the authors' layout with its sidecar beside it; images of 8 x 6 px."""
    for i, frame in enumerate(frames):
        write_image(root / "color" / f"{i:04d}.png", depth=False, value=i)
        write_image(root / "depth" / f"{i:04d}.png", depth=True, value=1000 + i)
        (root / "data").mkdir(exist_ok=True)
        (root / "data" / f"{i:04d}.json").write_text(json.dumps(frame))
    (root / "config.json").write_text(json.dumps(CONFIG if config is None else config))
    root.with_name(root.name + ".toml").write_text(SIDECAR)
    return root


def write_tum_folder(root: Path, t_color: list[float], t_depth: list[float], *, poses: str = "") -> Path:
    """A folder in the TUM layout with its sidecar beside it; images of 8 x 6 px."""
    for kind, stamps in (("rgb", t_color), ("depth", t_depth)):
        for stamp in stamps:
            write_image(root / kind / f"{stamp:.6f}.png", depth=kind == "depth")
        lines = [f"{stamp:.6f} {kind}/{stamp:.6f}.png" for stamp in stamps]
        (root / f"{kind}.txt").write_text("\n".join(["# stamp filename", *lines]) + "\n")
    if poses:
        (root / "groundtruth.txt").write_text(poses)
    root.with_name(root.name + ".toml").write_text(SIDECAR)
    return root

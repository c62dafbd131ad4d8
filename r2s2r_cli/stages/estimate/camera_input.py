"""What a recording holds for the camera tracker: its pictures as frames, its cable sensors as readings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.images import DecodedFrames, Encoded
from r2s2r_cli.stages.estimate.motion.data import Readings
from r2s2r_cli.stages.estimate.smooth import MIN_FRAMES
from r2s2r_cli.stages.estimate.unseen import Unseen
from r2s2r_cli.stages.frames import KEPT, keep_frames
from r2s2r_cli.stages.sensed import sensed_lengths
from schemas.robot import Robot

Pictures = Callable[[str, str], Encoded | None]
"""From a run and `color` or `depth` to its encoded pictures; None where there are none."""
_LENS = ("fx", "fy", "cx", "cy")
_PAIRED_S = 0.02
"""Colour and depth of recordings that do not say what belongs together: as far apart as TUM's tools allow."""


def kept_frames(run: str, streams: dict[str, Group], pictures: Pictures) -> tuple[np.ndarray, DecodedFrames]:
    """Rows of the recording's camera that are kept, (frame,), and the frames of these rows.

    Raises InputError: no pictures, unknown geometry or unit of depth, too few frames, a robot without colours.
    """
    color, depth = pictures(run, "color"), pictures(run, "depth")
    camera = streams["camera"]
    X_WC = camera.datasets.get("X_WC")
    where = f"runs/{run}/camera"
    if color is None or depth is None or "t" not in camera:
        missing = " and ".join(name for name, found in (("colour", color), ("depth", depth)) if found is None)
        raise Unseen(
            f"run {run} has no {missing or 'times of its'} pictures: the tracker needs colour and depth", where=where,
            expected="colour and depth images with their times", received=f"no {missing or 't'}",
            hint="r2s2r import recording   # a folder with color/ and depth/ in it",
        )  # fmt: skip
    facts = camera.attributes
    lost = [name for name in (*_LENS, "depth_scale") if name not in facts]
    if lost:
        raise InputError(
            f"the camera of run {run} is not described", where=where, expected=", ".join((*_LENS, "depth_scale")),
            received=f"no {', '.join(lost)}",
            hint="r2s2r import recording --force   # the authors' layout, with config.json; TUM's has none",
        )  # fmt: skip
    t = camera["t"]
    rows = np.flatnonzero(keep_frames(t) == KEPT)
    rows = rows[rows < len(color)]
    if len(rows) < MIN_FRAMES:
        raise InputError(
            f"run {run} has too few pictures to estimate a state", where=where,
            expected=f"at least {MIN_FRAMES} frames 20 ms apart", received=f"{len(rows)} of {len(t)}",
            hint="r2s2r inspect 10-record.h5",
        )  # fmt: skip
    width, height = int(facts["width"]), int(facts["height"])
    fx, fy, cx, cy = (float(facts[name]) for name in _LENS)
    lens = Intrinsics(width, height, fx, fy, cx, cy)
    return rows, DecodedFrames(
        lens=lens, depth_scale=float(facts["depth_scale"]), t=t[rows], color=_Some(color, rows), depth=depth,
        pair=_pairs(camera, len(t), len(depth))[rows], X_WC=X_WC if isinstance(X_WC, np.ndarray) else None, where=where,
    )  # fmt: skip


def sensor_readings(streams: dict[str, Group], robot: Robot) -> Readings | None:
    """The cable sensors of a run; None where it has none that give a length."""
    if "sensors" not in streams:
        return None
    sensors = streams["sensors"]
    found = sensed_lengths(sensors, robot)
    if found is None or not np.any(np.isfinite(found[0])):
        return None
    length, cable = found
    good = np.isfinite(sensors["t"]) & np.any(np.isfinite(length), axis=1)
    # A line of robot.toml turns the 0.20 pF of a chip that is not initialised into a negative length.
    return Readings(t=sensors["t"][good], length=np.where(length[good] > 0, length[good], np.nan), cable=cable)


class _Some:
    """Some of the pictures, by their place among these."""

    def __init__(self, pictures: Encoded, rows: np.ndarray) -> None:
        self._pictures, self._rows = pictures, rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: int) -> bytes:
        return self._pictures[int(self._rows[index])]


def _pairs(camera: Group, colors: int, depths: int) -> np.ndarray:
    """Number of the depth picture of each colour picture, -1: none, int64 (frame,)."""
    if "pair" in camera:
        pair = camera["pair"]
    elif "t_depth" in camera and depths:
        t, other = camera["t"], camera["t_depth"]
        pair = np.array([int(np.argmin(np.abs(other - stamp))) for stamp in t], dtype=np.int64)
        pair = np.where(np.abs(other[pair] - t) <= _PAIRED_S, pair, -1)
    else:
        pair = np.arange(colors, dtype=np.int64)
    return np.where((pair >= 0) & (pair < depths), pair, -1)

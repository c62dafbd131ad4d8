"""What the camera makes of the true end caps: effects of the camera, noise, and a tracker's error of the moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.blind.make.drive import Driven
from r2s2r_cli.blind.make.worlds import OFFSET_SHARE, Hidden
from r2s2r_cli.rig.camera.pinhole import knocked, pose
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.model.mjcf_text import ground_rotation

LEVEL = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Seen:
    """t: stamps [s], (frame,); p_WE: [m], (frame, cap, 3), NaN where a cap was lost."""

    t: np.ndarray
    p_WE: np.ndarray


def through(camera: CameraSettings, t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
    """Points as the host places them that trusts the camera's description: knock, scale of depth and of width. Trackers
    are levelled on the floor, as frame W is after `estimate`: of a slope the robot's weight tells, not its height.

    t: exposures [s], (frame,); p_WE: (frame, cap, 3) [m].
    """
    X_WC = pose(camera)
    found = np.empty_like(p_WE)
    for after, X_true in ((False, X_WC), (True, knocked(camera))):
        rows = (t >= camera.knocked_at_s) == after
        p_C = (p_WE[rows] - X_true[:3, 3]) @ X_true[:3, :3]
        deep = 1.0 + camera.depth_error
        p_C = p_C * np.array([deep * (1.0 + camera.focal_error)] * 2 + [deep])
        found[rows] = p_C @ X_WC[:3, :3].T + X_WC[:3, 3]
    return found if camera.floor_normal == LEVEL else found @ ground_rotation(camera.floor_normal)


def seen(run: Driven, camera: CameraSettings, hidden: Hidden, rng: np.random.Generator) -> Seen:
    """With noise. camera: with its effects (`World.seen`)."""
    t, p = run.t_frame, through(camera, run.t_frame, run.p_WE)
    p = p + noise(t, run.t[run.starts], p.shape[1], hidden, rng)
    # The rig loses pixels; of the caps' pixels most must be gone before a cap is: once in a while, for some frames.
    lost = _blobs(rng, p.shape[:2], camera.depth.hole_share - CameraSettings().depth.hole_share)
    p = np.where(lost[..., None], np.nan, p)
    there = rng.random(len(t)) >= camera.clock.lost_share
    return Seen((t + camera.clock.stamp_delay_s)[there], p[there])


def noise(t: np.ndarray, starts: np.ndarray, caps: int, hidden: Hidden, rng: np.random.Generator) -> np.ndarray:
    """Noise of the caps [m], (frame, cap, 3): AR(1) from frame to frame and a constant a target interval."""
    white = rng.standard_normal((len(t), caps, 3))
    found = np.empty_like(white)
    found[0] = white[0]
    for k in range(1, len(t)):
        found[k] = hidden.ar1 * found[k - 1] + np.sqrt(1.0 - hidden.ar1**2) * white[k]
    place = np.searchsorted(starts, t, side="right")
    offset = OFFSET_SHARE * rng.standard_normal((len(starts) + 1, caps, 3))
    return hidden.noise_m * (found + offset[place])


def _blobs(rng: np.random.Generator, shape: tuple[int, int], share: float, length: int = 4) -> np.ndarray:
    """Caps that are lost for `length` frames at a time, bool (frame, cap)."""
    begun = rng.random(shape) < max(share, 0.0) / length
    lost = begun.copy()
    for k in range(1, length):
        lost[k:] |= begun[:-k]
    return lost

"""What the rig's camera sees of a run: pictures instead of end caps, for sets that go through our own tracker.

The run is driven as for every other set, and the camera's own code draws what it would have sent; the same seed is the
same motion with and without pictures. Through the rig's server and `record` more would be shared with a recording, but
a hidden world has laws (offsets of the day, what no catalogue has) that no world file can tell the server. What
`record` takes out of the stamps again is left out: the camera's own clock with its drift, jitter and latency.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import Blobs, Group
from r2s2r_cli.blind.make.drive import Driven
from r2s2r_cli.rig.camera.camera import RigCamera
from r2s2r_cli.rig.camera.pinhole import pose
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.stages.record.camera import encode_color, encode_depth
from schemas.config import RecordSettings
from schemas.robot import Robot

KEPT = RecordSettings(jpeg_quality=90)
"""How pictures are kept: a third less room for colour than the default of `record`; most of it is depth anyway."""


def film(run: Driven, camera: CameraSettings, robot: Robot, rng: np.random.Generator) -> Group:
    """The stream `camera` of a recording. camera: with its effects (`World.seen`).

    Its pose and lens are those that the camera states: that it was knocked, or sees another scale, only pictures tell.
    rng: of noise and of frames that never leave the camera.
    """
    eye = RigCamera(robot, camera, seed=int(rng.integers(2**31)))
    stamp = run.t_frame + camera.clock.stamp_delay_s
    # What was stamped before the log begins, or after it ends, is in no log.
    there = (stamp >= 0.0) & (stamp <= run.t[-1]) & (rng.random(len(stamp)) >= camera.clock.lost_share)
    tick = np.clip(np.searchsorted(run.t, run.t_frame, side="right") - 1, 0, len(run.t) - 2)
    color, depth = [], []
    for k in np.flatnonzero(there).tolist():
        i = int(tick[k])
        v_WE = (run.caps[i + 1] - run.caps[i]) / (run.t[i + 1] - run.t[i])
        picture = eye.capture(k, float(run.t_frame[k]), run.p_WE[k], v_WE)
        color.append(encode_color(picture.color, KEPT))
        depth.append(encode_depth(picture.depth))
    return Group(
        datasets={
            "t": stamp[there], "t_depth": stamp[there], "pair": np.arange(len(color), dtype=np.int64),
            "color": Blobs(color, len(color)), "depth": Blobs(depth, len(depth)), "X_WC": pose(camera),
        },
        attributes={
            "width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy, "cx": camera.cx,
            "cy": camera.cy, "depth_scale": camera.depth_scale,
        },
    )  # fmt: skip

"""The camera that a few words on the command line name."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from r2s2r_cli.devices.camera import Camera
from r2s2r_cli.errors import UsageError

KINDS = "rig://HOST:PORT, realsense[:SERIAL], open3d[:SERIAL] or replay:FOLDER or FILE.h5[:RUN]"


def choose_camera(spec: str, *, now: Callable[[], float] = time.monotonic) -> Camera:
    """The camera, not open yet: `with choose_camera("rig://127.0.0.1:9000") as camera: ...`.

    now: the host's clock, for `Frame.t_host`. A recording is played back by `replay.ReplayCamera(films.recorded_film(
    data))`: reading it is the store's business. Raises UsageError for words that name none, CameraError for a folder
    that cannot be played back.
    """
    kind, _, rest = spec.partition(":")
    if kind == "rig":
        from r2s2r_cli.hardware.camera.rig import RigCamera

        host, _, port = rest.removeprefix("//").rpartition(":")
        if not (rest.startswith("//") and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
            raise _unknown(spec, "--camera rig://127.0.0.1:9000   # as r2s2r rig prints it")
        return RigCamera(host.strip("[]"), int(port), now=now)
    if kind == "realsense":
        from r2s2r_cli.hardware.camera.realsense import RealSenseCamera

        return RealSenseCamera(rest, now=now)
    if kind == "open3d":
        from r2s2r_cli.hardware.camera.realsense_open3d import Open3DCamera

        return Open3DCamera(rest, now=now)
    if kind == "replay" and rest:
        from r2s2r_cli.hardware.camera.films import folder_film
        from r2s2r_cli.hardware.camera.replay import ReplayCamera

        return ReplayCamera(folder_film(Path(rest)), now=now)
    raise _unknown(spec, "--camera realsense")


def _unknown(spec: str, hint: str) -> UsageError:
    return UsageError("this names no camera", where="--camera", expected=KINDS, received=spec, hint=hint)

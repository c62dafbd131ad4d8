"""The camera that `--camera` names, recordings to play back included."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from r2s2r_cli.devices.camera import Camera


def camera_of(spec: str, *, now: Callable[[], float] = time.monotonic) -> Camera:
    """The camera, not open yet. `replay:FILE.h5` and `replay:FILE.h5:RUN` play a recording back.

    now: the host's clock, for `Frame.t_host`. Raises UsageError for words that name no camera, CameraError or
    ArtifactError for what cannot be played back.
    """
    from r2s2r_cli.hardware.camera.choose import choose_camera

    kind, _, rest = spec.partition(":")
    path, _, run = rest.partition(".h5:")
    if kind != "replay" or not (run or rest.endswith(".h5")):
        return choose_camera(spec, now=now)
    from r2s2r_cli.hardware.camera.films import recorded_film
    from r2s2r_cli.hardware.camera.replay import ReplayCamera
    from r2s2r_cli.store.read import read_artifact

    file = Path(f"{path}.h5" if run else rest)
    _, data = read_artifact(file, "recording", blobs=True)
    return ReplayCamera(recorded_film(data, run or None), now=now)

"""The camera that `--camera` names, recordings to play back included."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from r2s2r_cli.devices.camera import Camera
    from r2s2r_cli.store.project import Project

_REPLAY, _ARTIFACT = "replay", ".h5"


def camera_of(spec: str, *, now: Callable[[], float] = time.monotonic) -> Camera:
    """The camera, not open yet. `replay:FILE.h5` and `replay:FILE.h5:RUN` play a recording back.

    now: the host's clock, for `Frame.t_host`. Raises UsageError for words that name no camera, CameraError or
    ArtifactError for what cannot be played back.
    """
    from r2s2r_cli.hardware.camera.choose import choose_camera

    kind, path, run = _split(spec)
    if kind != _REPLAY or path.suffix != _ARTIFACT:
        return choose_camera(spec, now=now)
    from r2s2r_cli.hardware.camera.films import recorded_film
    from r2s2r_cli.hardware.camera.replay import ReplayCamera
    from r2s2r_cli.store.read import read_artifact

    _, data = read_artifact(path, "recording", blobs=True)
    return ReplayCamera(recorded_film(data, run or None), now=now)


def require_named(spec: str | None) -> None:
    """Raises UsageError for words that name no camera. Pictures to play back are looked for when they are opened."""
    if spec is not None and _split(spec)[0] != _REPLAY:
        camera_of(spec)


def stored_camera(project: Project, spec: str | None) -> str | None:
    """The camera as typed here, for the provenance: as it would be typed in the project's directory.

    What `replay:` plays back is named from there where it lies in the project, else by its whole path: from another
    directory, or once the project was moved, a relative one would lead elsewhere. Other cameras stay as they are.
    """
    kind, path, run = _split(spec or "")
    if kind != _REPLAY or spec == f"{_REPLAY}:":
        return spec
    # Links are not followed: one that lies in the project belongs to it, wherever it leads on this machine.
    typed, root = (Path(os.path.normpath(one.absolute())) for one in (path, project.root))
    if not typed.is_relative_to(root):  # the working directory may be told by a link, or the project be named by one
        typed, root = path.resolve(), project.root.resolve()
    place = typed.relative_to(root) if typed.is_relative_to(root) else typed
    return f"{kind}:{place.as_posix()}" + (f":{run}" if run else "")


def _split(spec: str) -> tuple[str, Path, str]:
    """`replay:a/10-record.h5:walk` -> `replay`, the path and the run; the run is empty where none is named."""
    kind, _, rest = spec.partition(":")
    head, _, run = rest.partition(f"{_ARTIFACT}:")
    return kind, Path(f"{head}{_ARTIFACT}" if run else rest), run

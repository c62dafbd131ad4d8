"""Films to play back: the authors' folder, the folder of Open3D's recorder, a run of a recording."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Value
from r2s2r_cli.devices.camera import CameraError, Intrinsics
from r2s2r_cli.errors import quoted
from r2s2r_cli.hardware.camera.replay import Film

CONFIGS = ("config.json", "camera_intrinsic.json", "intrinsic.json")
"""The authors' recorder, and two names that Open3D gives the same file."""
RATE_HZ = 30.0
"""Of a film without stamps."""
_HALF_PIXEL = 0.5
"""OpenCV, librealsense and Open3D put the centre of the first pixel at 0, this project at 0.5."""
_MAX_JSON_BYTES = 1 << 20
_MAX_S = 1e15
"""[s]: a larger stamp, or one that is no number, is none."""


def folder_film(folder: Path, *, depth_scale: float | None = None) -> Film:
    """A folder with `color/`, `depth/` and the camera's configuration beside them; stamps from `data/` if it is there.

    depth_scale: [m] a count, where the configuration does not say it. Raises CameraError.
    """
    color, depth = _images(folder / "color"), _images(folder / "depth")
    if not color:
        raise _wrong(folder, "a folder color/ with pictures", "none", f"ls '{folder}'")
    config = next((folder / name for name in CONFIGS if (folder / name).is_file()), None)
    if config is None:
        raise _wrong(folder, f"one of {', '.join(CONFIGS)}", "none", f"ls '{folder}'")
    tree = _json(config)
    lens, stated = _configuration(config, tree)
    scale = stated if stated is not None else depth_scale
    if scale is None or not 1e-5 <= scale <= 1e-2:
        received = "none" if scale is None else f"{scale:g}"
        raise _wrong(config, "depth_scale: counts a metre, 1000 or 4000", received, f"add depth_scale to {config.name}")
    stamps = _stamps(folder / "data", color)
    times = stamps or {key: i / RATE_HZ for i, key in enumerate(color)}

    def pictures() -> Iterator[tuple[bytes, bytes | None, float]]:
        for key, path in color.items():
            if key in times:
                yield _picture(path), _picture(depth[key]) if key in depth else None, times[key]

    rate = RATE_HZ
    if len(times) > 1:
        gap = float(np.median(np.diff(sorted(times.values()))))
        rate = 1.0 / gap if gap > 0 else RATE_HZ
    return Film(f"replay of {folder.name or folder}", lens, scale, rate, pictures, stamped=bool(stamps))


def recorded_film(data: ArtifactData, run: str | None = None) -> Film:
    """The camera of a run of a recording, default the first that has one. Raises CameraError."""
    having = [name for name in data.runs() if isinstance(_dataset(data.group(name, "camera"), "color"), Blobs)]
    name = run if run is not None else next(iter(having), "")
    camera = data.group(name, "camera") if name in having else None
    if camera is None:
        raise _wrong("10-record.h5", f"a run with pictures: {', '.join(having) or 'there is none'}", run or "none",
                     "r2s2r inspect 10-record.h5")  # fmt: skip
    facts = camera.attributes
    missing = [key for key in ("fx", "fy", "cx", "cy", "depth_scale") if key not in facts]
    if missing:
        raise _wrong(f"10-record.h5, runs/{name}/camera", "its geometry", f"no {', '.join(missing)}",
                     "import the run again with the camera's configuration")  # fmt: skip
    fx, fy, cx, cy = (float(facts[key]) for key in ("fx", "fy", "cx", "cy"))
    lens = Intrinsics(int(facts["width"]), int(facts["height"]), fx, fy, cx, cy)
    t = camera["t"]
    pair = camera["pair"] if "pair" in camera else np.full(len(t), -1)

    def pictures() -> Iterator[tuple[bytes, bytes | None, float]]:
        shots = _InOrder(camera.datasets.get("depth"))
        for image, stamp, other in zip(_InOrder(camera.datasets["color"]).all(), t, pair, strict=True):
            yield image, shots.at(int(other)), float(stamp)

    rate = 1.0 / float(np.median(np.diff(t))) if len(t) > 1 else RATE_HZ
    return Film(f"replay of {name}", lens, float(facts["depth_scale"]), rate, pictures)


class _InOrder:
    """Encoded images of a recording, asked for by rising numbers: none but the last is kept."""

    def __init__(self, blobs: Value | None) -> None:
        self._blobs = blobs if isinstance(blobs, Blobs) else Blobs((), 0)
        self._rest, self._held, self._image = iter(self._blobs.items), -1, b""

    def all(self) -> Iterator[bytes]:
        return iter(self._blobs.items)

    def at(self, number: int) -> bytes | None:
        """Image `number`, None where there is none."""
        if not 0 <= number < self._blobs.count:
            return None
        if number < self._held:
            self._rest, self._held = self.all(), -1
        while self._held < number:
            self._image, self._held = next(self._rest), self._held + 1
        return self._image


def _dataset(group: Group | None, name: str) -> object:
    return group.datasets.get(name) if group is not None else None


def _images(folder: Path) -> dict[str, Path]:
    """Pictures by their number or name without the ending, in order."""
    if not folder.is_dir():
        return {}
    found = [p for p in folder.iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg")]
    return {p.stem: p for p in sorted(found, key=lambda p: [int(x) for x in re.findall(r"\d+", p.stem)] or [0])}


def _picture(path: Path) -> bytes:
    """Its bytes. Raises CameraError where it is gone, or may not be read: films are read while they are played."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise _wrong(path, "a picture", error.strerror or str(error), f"ls -l {quoted(path.parent)}") from error


def _stamps(folder: Path, color: dict[str, Path]) -> dict[str, float]:
    """Stamps [s] of the frames from `data/NNNN.json` (header.secs), from the first; empty where there are none."""
    found: dict[str, float] = {}
    for key in color:
        path = folder / f"{key}.json"
        if not path.is_file():
            continue
        header = _json(path).get("header")
        secs = header.get("secs") if isinstance(header, dict) else None
        if isinstance(secs, int | float) and abs(secs) < _MAX_S:
            found[key] = float(secs)
    first = next(iter(found.values()), 0.0)
    rising: dict[str, float] = {}
    last = -math.inf
    for key, stamp in found.items():
        if stamp - first > last:
            last = rising[key] = stamp - first
    return rising


def _configuration(path: Path, tree: dict[str, Any]) -> tuple[Intrinsics, float | None]:
    """Intrinsics, and the depth scale [m] where it is there."""
    try:
        if "cam_intr" in tree:
            K = np.array(tree["cam_intr"], dtype=float).reshape(3, 3)
            width, height = int(tree.get("im_w", 640)), int(tree.get("im_h", 480))
        else:
            K = np.array(tree["intrinsic_matrix"], dtype=float).reshape(3, 3).T  # column by column
            width, height = int(tree["width"]), int(tree["height"])
        counts = float(tree["depth_scale"]) if "depth_scale" in tree else None
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise _wrong(path, "cam_intr, or intrinsic_matrix, width and height", f"{type(error).__name__} {error}",
                     f"head {quoted(path)}") from None  # fmt: skip
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0 and width > 0 and height > 0):
        raise _wrong(path, "focal lengths above 0", f"{K.tolist()}", f"head {quoted(path)}")
    lens = Intrinsics(width, height, float(K[0, 0]), float(K[1, 1]),
                      float(K[0, 2]) + _HALF_PIXEL, float(K[1, 2]) + _HALF_PIXEL)  # fmt: skip
    return lens, 1.0 / counts if counts is not None and counts > 1 else None


def _json(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MAX_JSON_BYTES:
            raise ValueError("too large")
        tree = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise _wrong(path, "a JSON object", str(error)[:80], f"head {quoted(path)}") from None
    if not isinstance(tree, dict):
        raise _wrong(path, "a JSON object", type(tree).__name__, f"head {quoted(path)}")
    return tree


def _wrong(where: Path | str, expected: str, received: str, hint: str) -> CameraError:
    return CameraError("this cannot be played back", where=str(where), expected=expected, received=received, hint=hint)

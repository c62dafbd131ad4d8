"""The estimated robot drawn over what the camera saw: a strip of pictures, and a film."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import rod_color
from schemas.robot import Robot

Image = Callable[[int], np.ndarray | None]
"""From a row of the estimate's frames to the colour picture, RGB uint8 (v, u, 3); None: there is none."""

FILM_FRAMES = 900
"""A longer run is shown as time lapse: the film, and the memory that it takes, do not grow with the run."""
STRIP_FRAMES = 8
_RATE_HZ = 30.0
_SHIFT = 4
"""OpenCV draws at 1 / 2^4 of a pixel."""
_UNSEEN = (150, 150, 150)
_TEXT = (255, 255, 255)
_SURE = 7.8147
"""95 % of a Gaussian in three dimensions lies within the root of this."""
_MARGIN_PX = 24
_TILE_PX = 520
"""Small tiles are enlarged up to this width."""


def overlay_strip(data: ArtifactData, run: str, robot: Robot, image: Image) -> bytes | None:
    """PNG of STRIP_FRAMES pictures, spread over the run, and of the one in which the robot is least certain.

    They are cut to where the robot is. None where no picture can be had.
    """
    import cv2

    model = Model(data, run, robot)
    chosen = model.chosen()
    tiles = [model.tile(k, image(k)) for k in chosen]
    kept = [tile for tile in tiles if tile is not None]
    if not kept:
        return None
    columns = math.ceil(len(kept) / 2)
    height, width = (max(tile.shape[i] for tile in kept) for i in (0, 1))
    sheet = np.full((2 * height, columns * width, 3), 255, np.uint8)
    for i, tile in enumerate(kept):
        v, u = (i // columns) * height, (i % columns) * width
        sheet[v : v + tile.shape[0], u : u + tile.shape[1]] = tile
    good, png = cv2.imencode(".png", sheet[:, :, ::-1])
    return png.tobytes() if good else None


def overlay_film(data: ArtifactData, run: str, robot: Robot, image: Image) -> bytes | None:
    """MP4 (MPEG-4 part 2) of the run, at most FILM_FRAMES pictures; None where no picture or no encoder can be had."""
    import cv2

    model = Model(data, run, robot)
    t = model.frames["t"]
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), FILM_FRAMES)).astype(int))
    rate = _RATE_HZ if len(rows) < len(t) or len(t) < 2 else float(np.clip(1.0 / np.median(np.diff(t)), 1.0, 60.0))
    with tempfile.TemporaryDirectory(prefix="r2s2r-film-") as folder:
        path = Path(folder) / "film.mp4"
        film, written = None, 0
        for k in rows.tolist():
            picture = image(k)
            if picture is None:
                continue
            drawn = model.draw(k, picture)
            if film is None:
                size = (drawn.shape[1], drawn.shape[0])
                film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, size)
                if not film.isOpened():
                    return None
            film.write(np.ascontiguousarray(drawn[:, :, ::-1]))
            written += 1
        if film is None or not written:
            return None
        film.release()
        return path.read_bytes() if path.exists() else None


class Model:
    """The estimated robot of a run as its camera sees it. Raises KeyError for a run that no camera saw."""

    def __init__(self, data: ArtifactData, run: str, robot: Robot) -> None:
        camera, self.frames = data.groups[f"runs/{run}/camera"], data.groups[f"runs/{run}/frames"]
        sightings = data.groups[f"runs/{run}/sightings"]
        facts = camera.attributes
        self.width, self.height = int(facts["width"]), int(facts["height"])
        self._fx, self._fy, self._cx, self._cy = (float(facts[name]) for name in ("fx", "fy", "cx", "cy"))
        X_WC = camera["X_WC"]
        self._R, self._p = X_WC[:3, :3], X_WC[:3, 3]
        self._radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
        self._sighted = sightings["p_WE"]
        self._colors = [_rgb(rod_color(cap)) for cap in range(len(self._radius))]
        self._mode = mode_words(self.frames)

    def chosen(self) -> Sequence[int]:
        """Rows for the strip."""
        n = len(self.frames["t"])
        worst = int(np.argmax(np.trace(self.frames["cov_p_WE"], axis1=2, axis2=3).max(axis=1)))
        spread = np.linspace(0, n - 1, min(n, STRIP_FRAMES)).astype(int).tolist()
        return sorted({*spread, worst})

    def draw(self, k: int, picture: np.ndarray) -> np.ndarray:
        """A copy of the picture with rods, caps, sightings and 95 % ellipses of row k."""
        import cv2

        image = np.ascontiguousarray(picture.copy())
        center, radius = self._projected(self.frames["p_WE"][k])
        seen, _ = self._projected(self._sighted[k])
        quality = self.frames["quality"][k]
        for cap in range(0, len(center), 2):
            if np.isfinite(center[cap : cap + 2]).all():
                cv2.line(image, _at(center[cap]), _at(center[cap + 1]), self._colors[cap], 1, cv2.LINE_AA, _SHIFT)
        for cap, color in enumerate(self._colors):
            if not np.isfinite(center[cap]).all():
                continue
            used = quality[cap] in (0, 3)
            cv2.circle(image, _at(center[cap]), _sub(radius[cap]), color if used else _UNSEEN, 2 if used else 1,
                       cv2.LINE_AA, _SHIFT)  # fmt: skip
            self._ellipse(image, k, cap, center[cap], color if used else _UNSEEN)
            if np.isfinite(seen[cap]).all():
                at = tuple(np.round(seen[cap] - 0.5).astype(int).tolist())
                cv2.drawMarker(image, at, _TEXT, cv2.MARKER_TILTED_CROSS, 7, 1)
            corner = tuple(np.round(center[cap] + radius[cap]).astype(int).tolist())
            cv2.putText(image, str(cap), corner, cv2.FONT_HERSHEY_SIMPLEX, 0.45, _TEXT, 1, cv2.LINE_AA)
        words = f"{self.frames['t'][k]:.2f} s{self._mode[k]}"
        cv2.putText(image, words, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, _TEXT, 1, cv2.LINE_AA)
        return image

    def tile(self, k: int, picture: np.ndarray | None) -> np.ndarray | None:
        """The drawn picture, cut to where the robot is in any frame of the run."""
        import cv2

        if picture is None:
            return None
        low, high = self._window()
        part = self.draw(k, picture)[low[1] : high[1], low[0] : high[0]]
        zoom = max(1, _TILE_PX // part.shape[1])
        part = cv2.resize(part, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)
        words = f"{self.frames['t'][k]:.2f} s{self._mode[k]}"
        cv2.rectangle(part, (0, 0), (part.shape[1], 20), (0, 0, 0), -1)
        cv2.putText(part, words, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, _TEXT, 1, cv2.LINE_AA)
        return part

    def _window(self) -> tuple[tuple[int, int], tuple[int, int]]:
        center, radius = self._projected(self.frames["p_WE"].reshape(-1, 3), np.tile(self._radius, len(self._mode)))
        good = np.isfinite(center).all(axis=1)
        reach = float(np.max(radius[good], initial=0.0)) + _MARGIN_PX
        low = np.clip(center[good].min(axis=0) - reach, 0, (self.width - 2, self.height - 2)).astype(int)
        high = np.clip(center[good].max(axis=0) + reach, low + 2, (self.width, self.height)).astype(int)
        return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))

    def _projected(self, p_WE: np.ndarray, radius: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Where caps are in the picture [px], pixel centres at u + 0.5, and how large; NaN behind the camera."""
        p_CE = (p_WE - self._p) @ self._R
        z = np.where(p_CE[:, 2] > 1e-3, p_CE[:, 2], np.nan)
        pixel = np.stack([self._fx * p_CE[:, 0] / z + self._cx, self._fy * p_CE[:, 1] / z + self._cy], axis=-1)
        return pixel, self._fx * (self._radius if radius is None else radius) / z

    def _ellipse(self, image: np.ndarray, k: int, cap: int, center: np.ndarray, color: tuple[int, int, int]) -> None:
        """Where the centre lies with 95 %, as far as that is large enough to be seen."""
        import cv2

        p_CE = (self.frames["p_WE"][k, cap] - self._p) @ self._R
        z = p_CE[2]
        slope = np.array([[self._fx / z, 0, -self._fx * p_CE[0] / z**2], [0, self._fy / z, -self._fy * p_CE[1] / z**2]])
        cov = slope @ self._R.T @ self.frames["cov_p_WE"][k, cap] @ self._R @ slope.T
        value, vector = np.linalg.eigh(cov)
        axes = np.sqrt(np.maximum(value, 0.0) * _SURE)
        if axes[1] < 2.0:
            return
        angle = math.degrees(math.atan2(vector[1, 1], vector[0, 1]))
        size = (_sub(min(float(axes[1]), 4096.0)), _sub(min(float(axes[0]), 4096.0)))
        cv2.ellipse(image, _at(center), size, angle, 0, 360, color, 1, cv2.LINE_AA, _SHIFT)


def mode_words(frames: Group) -> list[str]:
    """What each frame had to do without, as `, blind`; empty: nothing."""
    return [", ".join(["", *_words(int(mode))]) for mode in frames["mode"]]


def _words(mode: int) -> Iterator[str]:
    for bit, word in ((16, "no picture"), (8, "lost"), (4, "blind"), (2, "partly hidden"), (1, "no sensors")):
        if mode & bit:
            yield word


def _at(pixel: np.ndarray) -> tuple[int, int]:
    """For OpenCV, whose first pixel is centred at 0."""
    u, v = np.clip(pixel - 0.5, -4096.0, 8192.0)
    return _sub(float(u)), _sub(float(v))


def _sub(length: float) -> int:
    return round(float(length) * (1 << _SHIFT))


def _rgb(color: str) -> tuple[int, int, int]:
    """Of `#rrggbb`, brightened: the robot's own colours would hide it on itself."""
    r, g, b = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return (r + 255) // 2, (g + 255) // 2, (b + 255) // 2

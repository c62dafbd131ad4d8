"""First, middle and last camera frame of a run: colour, and under it the depth that belongs to it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import Blobs, Group

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_SHOWN_PX = 640
"""Longest side of a drawn frame: more cannot be seen at the picture's size."""
_RANGE_PERCENT = (1, 99)
"""Depths outside these percentiles do not stretch the colour scale."""
_UNKNOWN, _BROKEN = "#c8c8c8", "#d4380d"


def has_frames(camera: Group) -> bool:
    """Whether any pictures are there to draw."""
    return any(_pictures(camera, name) is not None for name in ("color", "depth"))


def camera_height(camera: Group, width: float) -> float:
    """Height [inches] of the strip in a picture of `width`: a row for colour, one for depth."""
    aspect = float(camera.attributes["height"]) / float(camera.attributes["width"])
    rows = sum(_pictures(camera, name) is not None for name in ("color", "depth"))
    return rows * (min(1.0, aspect) * width / 3.6 + 0.35) + 0.3


def draw_camera(figure: SubFigure, camera: Group) -> None:
    """Draws the frames into `figure`; a frame that cannot be decoded says so in its place."""
    from matplotlib import colormaps

    color, depth = (_pictures(camera, name) for name in ("color", "depth"))
    rows = [name for name, images in (("color", color), ("depth", depth)) if images is not None]
    chosen = _chosen(len(camera["t"]) if "color" in rows else len(camera["t_depth"]))
    grid = figure.subplots(len(rows), len(chosen), squeeze=False)
    frames = chosen
    if color is not None:
        images = _decoded(color, chosen, is_depth=False)
        for axes, frame in zip(grid[0], chosen, strict=True):
            number = int(camera["source_frame"][frame]) if "source_frame" in camera else frame
            _show(axes, images.get(frame), f"colour frame {number}, {camera['t'][frame]:.2f} s")
        frames = [int(camera["pair"][i]) for i in chosen] if "pair" in camera else []
    if depth is None:
        return
    scale = float(camera.attributes.get("depth_scale", 1.0))
    unit = "m" if "depth_scale" in camera.attributes else "counts"
    counts = _decoded(depth, frames, is_depth=True)
    metres = {i: np.where(image > 0, scale * image, np.nan) for i, image in counts.items()}
    known = np.concatenate([image[np.isfinite(image)] for image in metres.values()] or [np.empty(0)])
    low, high = np.percentile(known, _RANGE_PERCENT) if known.size else (0.0, 1.0)
    colors = colormaps["viridis"].with_extremes(bad=_UNKNOWN)
    drawn = None
    for axes, frame in zip(grid[-1], frames, strict=False):
        title = "no depth for this frame" if frame < 0 else f"depth, {camera['t_depth'][frame]:.2f} s (grey: none)"
        drawn = _show(axes, metres.get(frame), title, cmap=colors, vmin=low, vmax=high) or drawn
    for axes in grid[-1][len(frames) :]:
        axes.set_axis_off()
    if drawn is not None:
        figure.colorbar(drawn, ax=list(grid[-1]), label=f"depth [{unit}]", shrink=0.8)


def _pictures(camera: Group, name: str) -> Blobs | None:
    """The pictures of a kind; None where there are none, as of a camera that failed before its first frame."""
    pictures = camera.datasets.get(name)
    return pictures if isinstance(pictures, Blobs) and pictures.count else None


def _chosen(count: int) -> list[int]:
    """First, middle and last of `count` frames, each once."""
    return sorted({0, count // 2, count - 1}) if count else []


def _decoded(blobs: Blobs, frames: Iterable[int], *, is_depth: bool) -> dict[int, np.ndarray]:
    """The wanted frames as arrays, RGB or counts, at most 640 px wide and high; undecodable ones are left out."""
    import cv2

    mode = cv2.IMREAD_UNCHANGED if is_depth else cv2.IMREAD_COLOR
    wanted = {frame for frame in frames if frame >= 0}
    found: dict[int, np.ndarray] = {}
    for i, data in enumerate(blobs.items if wanted else ()):
        if i in wanted:
            try:
                image = cv2.imdecode(np.frombuffer(data, np.uint8), mode)
            except cv2.error:
                continue
            if image is not None and (image.ndim == 2) == is_depth:
                step = -(-max(image.shape[:2]) // _SHOWN_PX)
                image = image[::step, ::step]
                found[i] = image if is_depth else np.ascontiguousarray(image[:, :, ::-1])
        if i >= max(wanted):
            break
    return found


def _show(axes: Any, image: np.ndarray | None, title: str, **options: Any) -> Any:
    axes.set_title(title, fontsize=9)
    if image is None:
        axes.set_axis_off()
        if not title.startswith("no depth"):
            axes.text(0.5, 0.5, "cannot be decoded", transform=axes.transAxes, ha="center", color=_BROKEN)
        return None
    axes.set(xticks=[], yticks=[])
    return axes.imshow(image, interpolation="nearest", **options)

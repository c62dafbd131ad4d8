"""One camera's view: frames made ready, the pixels about a point, lengths in pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.vision.colors import blank, hsv_of, mask
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.patch import Patch
from schemas.robot import HsvRange


@dataclass(frozen=True)
class Pictures:
    """One frame, made ready. color: RGB (v, u, 3). z [m] (v, u), 0 where unknown. index: of the frame."""

    index: int
    color: np.ndarray
    z: np.ndarray


class View:
    """A camera's lens, for colour and for depth.

    depth_scale: metres a count. shift_px: (u, v) by which depth lies beside colour. f: focal length, geometric mean of
    both axes [px].
    """

    def __init__(self, lens: Intrinsics, depth_scale: float, shift_px: tuple[float, float]) -> None:
        self.lens = Lens(lens)
        self.depth_lens = self.lens
        if any(shift_px):
            du, dv = shift_px
            self.depth_lens = Lens(Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.cx + du, lens.cy + dv,
                                              lens.distortion))  # fmt: skip
        self.depth_scale, self.shift_px = depth_scale, shift_px
        self.f = float(np.sqrt(lens.fx * lens.fy))

    def ready(self, frame: ImageFrame) -> Pictures | None:
        """The frame's pictures, None where there is no colour to be seen.

        Raises InputError for pictures that are not of this camera's size and type.
        """
        size = (self.lens.height, self.lens.width)
        if frame.color is None:
            return None
        _check(frame.color, (*size, 3), np.uint8, "colour", frame.index)
        if blank(frame.color):
            return None
        z = np.zeros(size)
        if frame.depth is not None:
            _check(frame.depth, size, np.uint16, "depth", frame.index)
            z = frame.depth * self.depth_scale
        return Pictures(frame.index, frame.color, z)

    def patch(self, pictures: Pictures, wanted: HsvRange, center: np.ndarray, reach_px: float) -> Patch | None:
        """The pixels within reach of a point of frame C; None where none of them is in the picture."""
        u, v = self.lens.project(center)
        r = reach_px
        u0, u1 = int(np.clip(np.floor(u - r), 0, self.lens.width)), int(np.clip(np.ceil(u + r), 0, self.lens.width))
        v0, v1 = int(np.clip(np.floor(v - r), 0, self.lens.height)), int(np.clip(np.ceil(v + r), 0, self.lens.height))
        if u1 - u0 < 3 or v1 - v0 < 3:
            return None
        area = (slice(v0, v1), slice(u0, u1))
        z = pictures.z[area]
        color = np.ascontiguousarray(pictures.color[area])
        colored = mask(hsv_of(color), wanted)
        return Patch(
            self.lens.x[area], self.lens.y[area], colored, z > 0, z, self.depth_lens.x[area],
            self.depth_lens.y[area], color, u0, v0,
        )  # fmt: skip

    def about(self, patch: Patch, center: np.ndarray, reach_px: float) -> Patch | None:
        """The part of a patch within reach of a point; None where nothing of it is."""
        u, v = self.lens.project(center)
        u0, u1 = max(int(np.floor(u - reach_px)) - patch.u0, 0), int(np.ceil(u + reach_px)) - patch.u0
        v0, v1 = max(int(np.floor(v - reach_px)) - patch.v0, 0), int(np.ceil(v + reach_px)) - patch.v0
        return patch.part(slice(v0, max(v1, v0)), slice(u0, max(u1, u0)))

    def px(self, off: np.ndarray, center: np.ndarray) -> float:
        """Length across the line of sight [px] of a difference of points [m] near `center`."""
        along = center / np.linalg.norm(center)
        return float(np.linalg.norm(off - (off @ along) * along) * self.f / center[2])

    def where_depth_is(self, colored: np.ndarray) -> np.ndarray:
        """Coloured pixels, bool (v, u), moved to where the depth picture has them."""
        du, dv = (round(shift) for shift in self.shift_px)
        if du == dv == 0:
            return colored
        moved = np.zeros_like(colored)
        h, w = colored.shape
        moved[max(dv, 0) : h + min(dv, 0), max(du, 0) : w + min(du, 0)] = colored[
            max(-dv, 0) : h + min(-dv, 0), max(-du, 0) : w + min(-du, 0)
        ]
        return moved


def _check(picture: np.ndarray, shape: tuple[int, ...], kind: type, name: str, index: int) -> None:
    if picture.shape != shape or picture.dtype != kind:
        raise InputError(
            f"a {name} picture is not one of this camera",
            where=f"frame {index}",
            expected=f"{np.dtype(kind)} {shape}",
            received=f"{picture.dtype} {picture.shape}",
            hint="r2s2r doctor camera --camera replay:10-record.h5",
        )

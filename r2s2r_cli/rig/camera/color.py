"""The colour picture: floor, coloured caps and dark rods, blurred where they move, darker and lighter, noisy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.rig.camera.bank import smooth
from r2s2r_cli.rig.camera.pinhole import Pinhole
from r2s2r_cli.rig.camera.render import View
from r2s2r_cli.rig.camera.settings import CameraSettings

TEXTURE_M = 0.002
"""Size of a texel of the floor; its pattern repeats after 512 of them."""
_TEXELS = 512
_GRAIN = 3.0
_SPARE = 256


class ColorSensor:
    """Turns what is there into what the camera reports."""

    def __init__(self, settings: CameraSettings, rng: np.random.Generator) -> None:
        self._settings = settings
        self._texture = smooth(rng.standard_normal((_TEXELS, _TEXELS)), _GRAIN) * settings.floor_texture
        self._noise: np.ndarray | None = None
        if settings.color.sd > 0:
            shape = (settings.height + _SPARE, settings.width + _SPARE, 3)
            drawn = rng.standard_normal(shape, dtype=np.float32) * settings.color.sd
            self._noise = np.clip(np.rint(drawn), -127, 127).astype(np.int8)

    def floor(self, lens: Pinhole, X_WC: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """The picture without solids, RGB (v, u, 3) float32; inverse: 1 / z of the floor (v, u), 0 where it is not."""
        settings = self._settings
        x, y = lens.rays()
        seen = inverse > 0
        z = np.where(seen, 1.0 / np.maximum(inverse, 1e-6), 0.0)
        p_CP = np.stack([z * x[None, :], z * y[:, None], z], axis=-1)
        p_WP = p_CP @ X_WC[:3, :3].T + X_WC[:3, 3]
        texel = np.floor(p_WP[..., :2] / TEXTURE_M).astype(np.int64) % _TEXELS
        picture = np.array(settings.floor_rgb, dtype=float) + self._texture[texel[..., 1], texel[..., 0]][..., None]
        for disc in settings.distractors:
            inside = ((p_WP[..., :2] - np.array(disc.center_m)) ** 2).sum(axis=-1) <= disc.radius_m**2
            picture[inside & seen] = disc.rgb
        picture[~seen] = 20.0
        return np.clip(picture, 0, 255).astype(np.float32)

    def report(
        self, floor: np.ndarray, views: Sequence[tuple[View, np.ndarray]], t: float, rng: np.random.Generator
    ) -> np.ndarray:
        """RGB uint8 (v, u, 3). floor: from `floor`. views: the solids at moments spread over the exposure, with their
        colours 0 .. 255 (solid, 3). t: rig time, for the drift of the exposure.
        """
        picture = floor.astype(np.uint16)
        rows, columns = _around([view for view, _ in views])
        if rows.stop > rows.start:
            part = floor[rows, columns]
            total = np.zeros_like(part)
            for view, rgb in views:
                one = part.copy()
                covered = view.label >= 0
                inner = one[view.top - rows.start :, view.left - columns.start :][
                    : covered.shape[0], : covered.shape[1]
                ]
                inner[covered] = rgb[view.label[covered]] * view.shade[covered][:, None]
                total += one
            picture[rows, columns] = np.rint(total / len(views))
        picture *= np.uint16(round(256 * self.gain(t)))
        picture >>= np.uint16(8)
        if self._noise is None:
            return picture.astype(np.uint8)
        v, u = rng.integers(0, _SPARE, size=2, endpoint=True)
        signed = picture.view(np.int16)
        signed += self._noise[v : v + picture.shape[0], u : u + picture.shape[1]]
        np.clip(signed, 0, 255, out=signed)
        return signed.astype(np.uint8)

    def gain(self, t: float) -> float:
        """Brightness at t, 1 at most."""
        color = self._settings.color
        return 1.0 - color.exposure_drift * 0.5 * (1 - np.cos(2 * np.pi * t / color.exposure_period_s))


def _around(views: Sequence[View]) -> tuple[slice, slice]:
    """Rows and columns that hold all views; empty where there is nothing in them."""
    held = [view for view in views if view.z.size]
    if not held:
        return slice(0, 0), slice(0, 0)
    return (
        slice(min(v.rows.start for v in held), max(v.rows.stop for v in held)),
        slice(min(v.columns.start for v in held), max(v.columns.stop for v in held)),
    )

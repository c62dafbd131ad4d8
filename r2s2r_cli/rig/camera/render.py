"""Depth and colour of spheres, cylinders and a plane, in closed form: each solid in its own rectangle of the picture.

A ray is p = t (x, y, 1), so t is the depth z itself. Sphere: |t d - c|^2 = r^2. Cylinder of axis w about a: the same
with the parts of d and a across w, and |t d.w - a.w| <= half its length; its flat ends are discs. No mesh, no GL.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.camera.pinhole import Pinhole
from r2s2r_cli.rig.camera.scene import Solids

NEAREST_M = 0.05
"""What reaches closer to the camera than this is not drawn."""
_LIGHT = np.array([-0.3, -0.4, -0.866])
"""Direction to the light in frame C: beside the camera, a little above."""
_AMBIENT = 0.45
"""Brightness of what is turned away from the light."""
_NONE = -1


@dataclass(frozen=True)
class View:
    """What the solids cover: rows top .. top + h, columns left .. left + w of the picture.

    z: depth [m], (h, w), inf where no solid is; label: number of the solid, -1 where none, (h, w); shade: brightness
    0 .. 1, (h, w).
    """

    top: int
    left: int
    z: np.ndarray
    label: np.ndarray
    shade: np.ndarray

    @property
    def rows(self) -> slice:
        """Rows of the picture."""
        return slice(self.top, self.top + self.z.shape[0])

    @property
    def columns(self) -> slice:
        """Columns of the picture."""
        return slice(self.left, self.left + self.z.shape[1])


def draw(lens: Pinhole, solids: Solids, margin: int = 0) -> View:
    """The solids, given in frame C, as the camera sees them. margin: so many more pixels on each side, if there."""
    boxes = _boxes(lens, solids)
    shown = [i for i, box in enumerate(boxes) if box is not None]
    if not shown:
        nothing = np.empty((0, 0))
        return View(0, 0, nothing, nothing.astype(np.int16), nothing)
    edges = np.array([box for box in boxes if box is not None])
    top, left = np.maximum(edges[:, :2].min(axis=0) - margin, 0)
    bottom, right = np.minimum(edges[:, 2:].max(axis=0) + margin, (lens.height, lens.width))
    x, y = lens.rays()
    size = (bottom - top, right - left)
    view = View(int(top), int(left), np.full(size, np.inf), np.full(size, _NONE, dtype=np.int16), np.zeros(size))
    for i in shown:
        r0, c0, r1, c1 = boxes[i] or (0, 0, 0, 0)
        part = (slice(r0 - top, r1 - top), slice(c0 - left, c1 - left))
        dx, dy = x[c0:c1][None, :], y[r0:r1][:, None]
        spheres = len(solids.center)
        if i < spheres:
            z, facing = _sphere(dx, dy, solids.center[i], solids.radius[i])
        else:
            k = i - spheres
            z, facing = _cylinder(dx, dy, solids.middle[k], solids.axis[k], solids.half[k], solids.girth[k])
        nearer = z < view.z[part]
        view.z[part][nearer] = z[nearer]
        view.label[part][nearer] = i
        view.shade[part][nearer] = facing[nearer]
    return view


def plane_depth(lens: Pinhole, normal: np.ndarray, offset: float) -> np.ndarray:
    """1 / z of the plane normal . p = offset (frame C) at every pixel [1/m], (v, u) float32; 0 where it is not seen."""
    x, y = lens.rays()
    across = normal[0] * x[None, :] + normal[1] * y[:, None] + normal[2]
    with np.errstate(divide="ignore"):
        inverse = across / offset if offset != 0 else np.zeros_like(across)
    return np.where(inverse > 0, inverse, 0.0).astype(np.float32)


def _boxes(lens: Pinhole, solids: Solids) -> list[tuple[int, int, int, int] | None]:
    """Rows and columns (from, to) that each solid can touch; None where it is out of the picture or too close."""
    reach = solids.half[:, None] * solids.axis
    low = np.concatenate([solids.center, solids.middle - reach])
    high = np.concatenate([solids.center, solids.middle + reach])
    size = np.concatenate([solids.radius, solids.girth])
    nearest = np.minimum(low[:, 2], high[:, 2]) - size
    boxes: list[tuple[int, int, int, int] | None] = []
    for a, b, r, z in zip(low, high, size, nearest, strict=True):
        if z < NEAREST_M:
            boxes.append(None)
            continue
        # A ball of radius r at (x, z) is seen under slopes that differ from x / z by at most this.
        ends = []
        for p in (a, b):
            slope = np.hypot(np.hypot(p[0], p[1]) / p[2], 1.0)
            spread = r * slope / z
            ends.append((p[0] / p[2] - spread, p[1] / p[2] - spread, p[0] / p[2] + spread, p[1] / p[2] + spread))
        u0, v0 = (min(e[k] for e in ends) for k in (0, 1))
        u1, v1 = (max(e[k] for e in ends) for k in (2, 3))
        left, right = int(np.floor(lens.fx * u0 + lens.cx)), int(np.ceil(lens.fx * u1 + lens.cx))
        top, bottom = int(np.floor(lens.fy * v0 + lens.cy)), int(np.ceil(lens.fy * v1 + lens.cy))
        box = (max(top, 0), max(left, 0), min(bottom, lens.height), min(right, lens.width))
        boxes.append(box if box[0] < box[2] and box[1] < box[3] else None)
    return boxes


def _sphere(x: np.ndarray, y: np.ndarray, c: np.ndarray, r: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth (inf: missed) and brightness of a sphere about c for rays (x, y, 1)."""
    dd = x * x + y * y + 1.0
    dc = (x * c[0] + c[2]) + y * c[1]
    under = dc * dc - dd * (c @ c - r * r)
    hit = under >= 0
    z = np.where(hit, (dc - np.sqrt(np.where(hit, under, 0.0))) / dd, np.inf)
    depth = np.where(hit, z, 0.0)
    facing = (depth * ((x * _LIGHT[0] + _LIGHT[2]) + y * _LIGHT[1]) - c @ _LIGHT) / r
    return z, _brightness(facing)


def _cylinder(
    x: np.ndarray, y: np.ndarray, a: np.ndarray, w: np.ndarray, half: float, r: float
) -> tuple[np.ndarray, np.ndarray]:
    """Depth (inf: missed) and brightness of a cylinder of axis w about a, with flat ends."""
    aw = a @ w
    dw = (x * w[0] + w[2]) + y * w[1]
    da = (x * a[0] + a[2]) + y * a[1]
    dd = (x * x + 1.0) + y * y
    A = np.maximum(dd - dw * dw, 1e-15)
    B = da - dw * aw
    under = B * B - A * (a @ a - aw * aw - r * r)
    hit = under >= 0
    z = (B - np.sqrt(np.where(hit, under, 0.0))) / A
    s = z * dw - aw
    side = hit & (np.abs(s) <= half)
    light = (x * _LIGHT[0] + _LIGHT[2]) + y * _LIGHT[1]
    facing = (z * light - a @ _LIGHT - s * (w @ _LIGHT)) / r
    z = np.where(side, z, np.inf)
    # At most one flat end faces the camera: the one beyond whose plane the camera lies.
    for sign in (1.0, -1.0):
        if sign * aw + half < 0:
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (aw + sign * half) / dw
                off = t * t * dd - 2 * t * da + a @ a - half * half
                on = (t > 0) & (off <= r * r)
            nearer = on & (t < z)
            z, facing = np.where(nearer, t, z), np.where(nearer, sign * (w @ _LIGHT), facing)
    return z, _brightness(facing)


def _brightness(facing: np.ndarray) -> np.ndarray:
    return np.asarray(_AMBIENT + (1.0 - _AMBIENT) * np.clip(facing, 0.0, 1.0))

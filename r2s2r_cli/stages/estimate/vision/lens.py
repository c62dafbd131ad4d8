"""Where the rays of the pixels go, and where a point is seen; with OpenCV's distortion if the camera states one."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics


class Lens:
    """The rays of a camera's pixels, worked out once.

    x, y: slopes x / z and y / z of frame C at the centre of every pixel (v, u), float64; du_dx, dv_dy: pixels a unit
    of slope in the middle of the picture.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = k = intrinsics
        self.width, self.height, self.fx, self.fy = k.width, k.height, k.fx, k.fy
        u, v = np.arange(k.width) + 0.5, np.arange(k.height) + 0.5
        x, y = (u - k.cx) / k.fx, (v - k.cy) / k.fy
        self.x, self.y = (np.ascontiguousarray(a) for a in np.broadcast_arrays(x[None, :], y[:, None]))
        if any(k.distortion):
            import cv2

            matrix = np.array([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1.0]])
            pixels = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1).reshape(-1, 1, 2)
            slopes = cv2.undistortPoints(pixels, matrix, np.array(k.distortion, dtype=float))
            self.x, self.y = (
                np.ascontiguousarray(slopes[:, 0, i].reshape(k.height, k.width).astype(float)) for i in (0, 1)
            )

    def project(self, p_C: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) as (u, v) of points (..., 3) [m] in front of the camera; pixel centres are at + 0.5."""
        k = self.intrinsics
        x, y = p_C[..., 0] / p_C[..., 2], p_C[..., 1] / p_C[..., 2]
        if any(k.distortion):
            k1, k2, p1, p2, k3 = (*k.distortion[:5], *([0.0] * (5 - len(k.distortion[:5]))))
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x, y = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)  # fmt: skip
        return np.stack([k.fx * x + k.cx, k.fy * y + k.cy], axis=-1)

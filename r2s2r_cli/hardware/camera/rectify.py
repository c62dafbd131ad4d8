"""Pictures without lens distortion: what comes after knows a pinhole and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics

_HALF_PIXEL = 0.5
"""OpenCV puts the centre of the first pixel at 0, this project at 0.5."""


class Rectifier:
    """Straightens frames of one lens; `intrinsics` are those of what comes out."""

    def __init__(self, lens: Intrinsics) -> None:
        """lens: with OpenCV's coefficients k1, k2, p1, p2, k3; without any, frames go through as they are."""
        self.intrinsics = replace(lens, distortion=())
        self._maps: tuple[np.ndarray, np.ndarray] | None = None
        if lens.distortion:
            import cv2

            cx, cy = lens.cx - _HALF_PIXEL, lens.cy - _HALF_PIXEL
            K = np.array([[lens.fx, 0.0, cx], [0.0, lens.fy, cy], [0.0, 0.0, 1.0]])
            size = (lens.width, lens.height)
            u, v = cv2.initUndistortRectifyMap(K, np.array(lens.distortion), np.eye(3), K, size, cv2.CV_32FC1)
            self._maps = (np.asarray(u), np.asarray(v))

    def __call__(self, color: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Colour is interpolated; depth takes the nearest pixel: a mean over an edge would be a place in the air."""
        if self._maps is None:
            return color, depth
        import cv2

        u, v = self._maps
        straight = cv2.remap(color, u, v, cv2.INTER_LINEAR), cv2.remap(depth, u, v, cv2.INTER_NEAREST)
        return np.asarray(straight[0]), np.asarray(straight[1])

"""What is known about the camera and the floor before a frame is read: all that a sighting needs besides the frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.plane import Ground


@dataclass(frozen=True)
class Survey:
    """The camera as a look at some frames of the run shows it.

    ground: in frame C, mean over the frames looked at; None where none is seen. X_WC: pose of the camera (4, 4).
    noise: of depth. shift_px: (u, v) by which depth lies beside colour. swell_px: by which the discs in colour are
    larger than the caps are. warnings: what a person should know, in words.
    """

    X_WC: np.ndarray
    ground: Ground | None = None
    noise: DepthNoise = field(default_factory=DepthNoise)
    shift_px: tuple[float, float] = (0.0, 0.0)
    swell_px: float = 0.0
    swell_sd_px: float = 0.3
    frames: tuple[int, ...] = ()
    warnings: tuple[str, ...] = field(default=())
    height_sd: float = float("nan")
    """Of the camera's distance from the ground [m]; NaN: not known."""

    def with_colors(self, *, shift_px: tuple[float, float], swell_px: float, swell_sd_px: float) -> Survey:
        """The same with what the caps showed."""
        return replace(self, shift_px=shift_px, swell_px=swell_px, swell_sd_px=swell_sd_px)

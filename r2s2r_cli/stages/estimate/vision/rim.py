"""What colour tells of a ball: which pixels are on it, and where its rim is, as normal equations.

f: focal length [px].
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.vision.blend import INNER, shares
from r2s2r_cli.stages.estimate.vision.disc import Disc
from r2s2r_cli.stages.estimate.vision.patch import Patch, grown

RIM_PX = 1.5
"""Width over which the modelled disc goes from 1 to 0."""
WIDE_PX = 3.0
"""The same in the first step, when its place is not certain to a pixel."""
PIXEL_SD = 0.32
"""What a pixel of the mask differs by from the modelled rim: 1 / sqrt(12) as it is yes or no, and colour noise."""


def ball_share(patch: Patch, valid: np.ndarray, disc: Disc, f: float) -> np.ndarray:
    """How much of each pixel is the ball; by the mask alone where little of the ball is seen."""
    inside = valid & patch.colored & (disc.rho < INNER * disc.rim)
    found = shares(patch.color, inside, disc.a / disc.rim, disc.b / disc.rim, disc.rim * f)
    return patch.colored if found is None else found


def contradicting(share: np.ndarray, valid: np.ndarray, disc: Disc, f: float) -> np.ndarray:
    """Pixels about colour well outside of the disc, and about none well inside: another thing is in the way."""
    px = 1.0 / f
    colored = share > 0.5
    outside = colored & (disc.rho > disc.rim + 2.0 * px) & (disc.rho < disc.rim + 5.0 * px)
    inside = ~colored & valid & (disc.rho < disc.rim - 2.0 * px)
    # A single pixel is noise.
    wrong = _in_company(outside) | _in_company(inside)
    return grown(wrong, 2) if wrong.any() else wrong


def rim_equations(
    share: np.ndarray, told: np.ndarray, disc: Disc, f: float, *, delta: float, width: float
) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (4, 4) and right-hand side (4,) of the rim: metres across, across, along, px swelling.

    share: of the ball in each pixel; told: those that count. Both (v, u). delta: swelling so far [px]. width: over
    which the disc goes from 1 to 0 [px].
    """
    rise = (disc.rim + delta / f - disc.rho) * f / width
    on = told & (np.abs(rise) < 0.5)
    if not on.any():
        return np.zeros((4, 4)), np.zeros(4)
    rho, rise = disc.rho[on], rise[on]
    J = np.empty((len(rho), 4))
    per_m = f / (width * disc.D)
    J[:, 0], J[:, 1] = disc.a[on] / rho * per_m, disc.b[on] / rho * per_m
    J[:, 2], J[:, 3] = -disc.rim * per_m, 1.0 / width
    r = share[on] - 0.5 - rise
    # A wider rim has more pixels on it, each telling less: the same number of edges all the same.
    weight = RIM_PX / (width * PIXEL_SD**2) * (width / RIM_PX) ** 2
    return weight * (J.T @ J), weight * (J.T @ r)


def _in_company(pixels: np.ndarray) -> np.ndarray:
    """Pixels that have two others beside them."""
    import cv2

    if not pixels.any():
        return pixels
    count = cv2.boxFilter(pixels.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(pixels & (count >= 3))

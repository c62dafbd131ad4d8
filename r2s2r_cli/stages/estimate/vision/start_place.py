"""Where to begin: the place at which the disc of a ball fits the pixels of its colour best, to a pixel."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.vision.disc import Disc
from r2s2r_cli.stages.estimate.vision.patch import Patch


def start_place(
    patch: Patch,
    told: np.ndarray,
    about: Patch,
    hidden: np.ndarray,
    center: np.ndarray,
    radius: float,
    reach_px: float,
    *,
    f: float,
    swell_px: float,
) -> np.ndarray:
    """A start within a pixel [m] (3,): `center`, moved to where the colour fits what should be seen.

    told: pixels of the patch whose colour tells something. about: the part of the patch that a ball at `center`
    covers; hidden: its pixels where something is before that ball; it moves with the ball, as the rod behind it
    does. Both bool (v, u). reach_px: three standard deviations of the prediction; the start is no farther off, and
    of two places that fit equally well it is the nearer. The distance stays.
    """
    import cv2

    disc = Disc.of(center, radius, about.x, about.y)
    model = np.clip(0.5 + (disc.rim + swell_px / f - disc.rho) * f, 0.0, 1.0) * ~hidden
    template, v0, u0 = model.astype(np.float32), about.v0 - patch.v0, about.u0 - patch.u0
    # A border of nothing: a ball may lie half outside of the patch.
    pad = max(template.shape) // 2

    def padded(picture: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.copyMakeBorder(picture.astype(np.float32), pad, pad, pad, pad, cv2.BORDER_CONSTANT))

    # sum told (colored - model)^2 for every place, but for what does not depend on it
    cost = np.asarray(cv2.matchTemplate(padded(told), template**2, cv2.TM_CCORR), dtype=float)
    cost = cost - 2 * np.asarray(cv2.matchTemplate(padded(told & patch.colored), template, cv2.TM_CCORR))
    dv = np.arange(cost.shape[0]) - pad - v0
    du = np.arange(cost.shape[1]) - pad - u0
    far = dv[:, None] ** 2 + du[None, :] ** 2
    cost = np.where(far > (reach_px + 1.0) ** 2, np.inf, cost + 0.5 * far / max(reach_px / 3, 1.0) ** 2)
    k, i = divmod(int(np.argmin(cost)), cost.shape[1])
    move = np.array([du[i], dv[k], 0.0]) * center[2] / f
    return np.asarray(center + move)

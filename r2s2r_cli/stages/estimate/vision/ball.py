"""Where a ball of known radius is, from the pixels of its colour and the depths on it: Gauss-Newton, with covariance.

Across the line of sight the rim of its disc tells it (`rim`), along the line the depths do (`depths`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.vision.depths import Depths, along_sight, depth_equations, depths_on
from r2s2r_cli.stages.estimate.vision.disc import Disc
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.patch import Patch
from r2s2r_cli.stages.estimate.vision.rim import RIM_PX, WIDE_PX, ball_share, contradicting, rim_equations

RIM_SD_PX2 = 0.7
"""Common error of the disc across the line of sight, times its radius [px^2]: uneven light, a rim that the range cuts
on one side. JPEG has colour in blocks of two pixels, so the rim of a small disc is known worse than its number of
pixels says: on tuning runs the whole error is 0.09 px where discs have a radius of 7 px and 0.14 px where they have 4.
Much of it lasts longer than the second for which the smoother takes it to be alike, so that more is stated."""
MASK_SD_PX = 0.35
"""The same where too little is seen to tell how much of a pixel is the ball: what lies beside moves a mask."""
ALONG_SD_M = 3e-4
"""Common error along the line of sight: rounding, and noise that is not quite as the floor shows it."""
SHIFT_SD_PX = 3.0
"""Less certain, a comparison of depth and colour is not told."""
_STEPS = 4
_STEP_PX = 3.0
BLIND_SD_M = 0.1
"""Along the line of sight of a cap without depth; its size would tell more, with the error of a half hidden rim."""


@dataclass(frozen=True)
class BallFit:
    """A ball's centre [m] (3,) with covariance [m^2] (3, 3) in frame C.

    visible: share of its disc in its colour. rim: share of its rim that told anything. depths: how many were used.
    shift_px: lateral place by depth alone minus that by colour alone [px] (2,), with covariance; NaN: cannot tell.
    swell_px: by which the disc is larger than modelled, with standard deviation.
    """

    center: np.ndarray
    cov: np.ndarray
    visible: float
    rim: float
    depths: int
    shift_px: np.ndarray
    shift_cov_px: np.ndarray
    swell_px: float
    swell_sd_px: float


class BallFitter:
    """Fits balls; what it knows of the camera stays the same for all of them.

    f: focal length [px]. noise: of depth. swell_px, swell_sd_px: by how much the discs look larger, and how well that
    is known.
    """

    def __init__(self, f: float, noise: DepthNoise, swell_px: float, swell_sd_px: float) -> None:
        self.f, self.noise = f, noise
        self.swell_px, self.swell_sd_px = swell_px, swell_sd_px

    def fit(
        self,
        patch: Patch,
        valid: np.ndarray,
        seen: np.ndarray,
        center: np.ndarray,
        radius: float,
        *,
        far: float,
        far_sd: float,
    ) -> BallFit:
        """The ball from a start within a pixel or two.

        valid: pixels whose colour tells something. seen: pixels whose depth may lie on the ball. Both bool (v, u).
        far, far_sd: distance [m] from the camera as it is predicted, and its standard deviation; it is kept where no
        depth tells the distance, and the covariance does not count it.
        """
        start = c = along_sight(patch, seen, center, radius)
        delta = self.swell_px
        told, depths, share = valid, Depths.none(), patch.colored
        for k in range(_STEPS):
            disc = Disc.of(c, radius, patch.x, patch.y)
            if k == 1:
                share = ball_share(patch, valid, disc, self.f)
                told = valid & ~contradicting(share, valid, disc, self.f)
                depths = depths_on(patch, seen, c, radius, disc, self.noise, self.f)
            rim, pull = rim_equations(share, told, disc, self.f, delta=delta, width=RIM_PX if k else WIDE_PX)
            line, draw = depth_equations(depths, c, radius, disc, self.noise, self.f)
            A, g = rim.copy(), pull.copy()
            A[:3, :3] += line
            g[:3] += draw
            A[3, 3] += self.swell_sd_px**-2
            g[3] += (self.swell_px - delta) * self.swell_sd_px**-2
            hold = np.array([1.0, 1.0, 100.0 if len(depths.z) else far_sd**-2])
            A[:3, :3] += np.diag(hold)
            back = disc.E.T @ (start - c)
            back[2] = far - disc.D
            g[:3] += hold * back
            cov = np.linalg.inv(A)
            step = cov @ g
            limit = _STEP_PX * c[2] / self.f
            c = c + disc.E @ np.clip(step[:3], -limit, limit)
            delta += float(np.clip(step[3], -0.5, 0.5))
        common = RIM_SD_PX2 / max(disc.rim * self.f, 1.0)
        across = ((max(MASK_SD_PX, common) if share is patch.colored else common) * c[2] / self.f) ** 2
        along = ALONG_SD_M if len(depths.z) else BLIND_SD_M
        cov_C = disc.E @ (cov[:3, :3] + np.diag([across, across, along**2])) @ disc.E.T
        edge = np.abs(disc.rho - disc.rim) * self.f < RIM_PX / 2
        expected = np.pi * (disc.rim * self.f) ** 2
        shift, shift_cov = self._shift(disc, rim[:2, :2], pull[:2], line, draw)
        return BallFit(
            c, cov_C, float((patch.colored & (disc.rho < disc.rim)).sum() / expected),
            float((told & edge).sum() / max(edge.sum(), 1)), len(depths.z), shift, shift_cov, delta,
            float(np.sqrt(cov[3, 3])),
        )  # fmt: skip

    def _shift(
        self, disc: Disc, rim: np.ndarray, pull: np.ndarray, line: np.ndarray, draw: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lateral place by depth alone minus by colour alone [px], (2,), (2, 2); NaN where one tells nothing."""
        B, A = line + np.eye(3), rim + np.eye(2)
        cov = np.linalg.inv(B)[:2, :2] + np.linalg.inv(A)
        px = self.f / (disc.D * disc.E[2, 2])
        if not np.trace(cov) * px**2 < SHIFT_SD_PX**2:
            return np.full(2, np.nan), np.full((2, 2), np.nan)
        # The axes across the line of sight are those of the picture but for the slant of a cap far off its middle.
        turn = disc.E[:2, :2]
        off = np.linalg.solve(B, draw)[:2] - np.linalg.solve(A, pull)
        return turn @ off * px, turn @ cov @ turn.T * px**2

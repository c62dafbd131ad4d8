"""Where a ball of known radius is, from the pixels of its colour and the depths on it: Gauss-Newton, with covariance.

Across the line of sight the rim of the disc tells it, along the line the depths do. A ball about c is seen under the cone of half angle
asin(r / |c|) about c, so in slopes about the direction of c its rim is a circle wherever it lies in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.patch import Patch, grown
from r2s2r_cli.stages.estimate.vision.solids import ball_depth

RIM_PX = 1.5
"""Width over which the modelled disc goes from 1 to 0."""
WIDE_PX = 3.0
"""The same in the first step, when its place is not certain to a pixel."""
PIXEL_SD = 0.32
"""What the mask differs by from the modelled rim, a pixel: 1 / sqrt(12) from its being yes or no, and the colour's noise."""
RIM_SD_PX = 0.05
"""Common error of the disc across the line of sight: uneven light, a rim that the range cuts on one side."""
CORE = 0.85
"""Depths beyond this share of the disc's radius are left out: edges fray there."""
DEPTHS = 64
"""Depths that are used at most; neighbours share most of their error, so more would tell nothing more."""
GATE_SD = 4.0
_STEPS = 4
_STEP_PX = 3.0


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


@dataclass
class _Disc:
    """The disc of a ball as the patch's rays see it: slopes a, b about its direction, and rho, their length."""

    E: np.ndarray  # columns: across, across, along
    D: float
    a: np.ndarray
    b: np.ndarray
    rho: np.ndarray
    rim: float

    @classmethod
    def of(cls, center: np.ndarray, radius: float, x: np.ndarray, y: np.ndarray) -> _Disc:
        D = float(np.linalg.norm(center))
        along = center / D
        first = np.array([along[2], 0.0, -along[0]])
        first /= np.linalg.norm(first)
        E = np.column_stack([first, np.cross(along, first), along])
        q = x * along[0] + y * along[1] + along[2]
        a = (x * E[0, 0] + y * E[1, 0] + E[2, 0]) / q
        b = (x * E[0, 1] + y * E[1, 1] + E[2, 1]) / q
        return cls(E, D, a, b, np.hypot(a, b), radius / float(np.sqrt(max(D * D - radius**2, 1e-9))))


class BallFitter:
    """Fits balls; what it knows of the camera stays the same for all of them.

    f: focal length [px]. noise: of depth. swell_px, swell_sd_px: by how much the discs look larger, and how well that is
    known.
    """

    def __init__(self, f: float, noise: DepthNoise, swell_px: float, swell_sd_px: float) -> None:
        self.f, self.noise = f, noise
        self.swell_px, self.swell_sd_px = swell_px, swell_sd_px

    def place(
        self, patch: Patch, told: np.ndarray, hidden: np.ndarray, center: np.ndarray, radius: float, sd_px: float
    ) -> np.ndarray:
        """A start within a pixel [m] (3,): `center` moved across the picture to where the colour fits what should be seen.

        told: pixels whose colour tells something. hidden: pixels where something is before the ball if it is at `center`; it moves with the
        ball, as the rod behind it does. Both bool (v, u). sd_px: of the prediction; of two places that fit
        equally well the likelier one is taken. The distance stays.
        """
        import cv2

        disc = _Disc.of(center, radius, patch.x, patch.y)
        model = np.clip(0.5 + (disc.rim + self.swell_px / self.f - disc.rho) * self.f, 0.0, 1.0) * ~hidden
        rows, columns = (np.nonzero((disc.rho * self.f < disc.rim * self.f + 2.0).any(axis=axis))[0] for axis in (1, 0))
        if not len(rows):
            return center
        v0, v1, u0, u1 = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        template = model[v0:v1, u0:u1].astype(np.float32)
        # A border of nothing: a ball may lie half outside of the patch.
        pad = max(template.shape) // 2

        def padded(picture: np.ndarray) -> np.ndarray:
            return np.asarray(cv2.copyMakeBorder(picture.astype(np.float32), pad, pad, pad, pad, cv2.BORDER_CONSTANT))

        # sum told (colored - model)^2 for every place, but for what does not depend on it
        cost = cv2.matchTemplate(padded(told), template**2, cv2.TM_CCORR)
        cost -= 2 * cv2.matchTemplate(padded(told & patch.colored), template, cv2.TM_CCORR)
        dv = np.arange(cost.shape[0]) - pad - v0
        du = np.arange(cost.shape[1]) - pad - u0
        cost = cost + 0.5 * (dv[:, None] ** 2 + du[None, :] ** 2) / max(sd_px, 1.0) ** 2
        k, i = divmod(int(np.argmin(cost)), cost.shape[1])
        move = np.array([du[i], dv[k], 0.0]) * center[2] / self.f
        return np.asarray(center + move)

    def fit(
        self, patch: Patch, valid: np.ndarray, seen: np.ndarray, center: np.ndarray, radius: float
    ) -> BallFit | None:
        """The ball from a start within a pixel or two; None where too little is seen of it.

        valid: pixels whose colour tells something. seen: pixels whose depth may lie on the ball. Both bool (v, u).
        """
        c, delta = center.copy(), self.swell_px
        depths = self._depths(patch, seen, c, radius)
        for _ in range(2):
            c = self._along(patch, depths, c, radius)
        told = valid
        A = np.zeros((4, 4))
        for k in range(_STEPS):
            disc = _Disc.of(c, radius, patch.x, patch.y)
            if k < 2:
                told = valid & ~self._contradicting(patch, valid, disc)
            A, g = self._rim(patch, told, disc, delta, RIM_PX if k else WIDE_PX)
            if k == 1:
                depths = self._depths(patch, seen, c, radius)
            J, r, C = self._lines(patch, depths, c, radius, disc)
            if len(r):
                W = np.linalg.solve(C, np.column_stack([J, r]))
                A[:3, :3] += J.T @ W[:, :3]
                g[:3] += J.T @ W[:, 3]
            A[3, 3] += self.swell_sd_px**-2
            g[3] += (self.swell_px - delta) * self.swell_sd_px**-2
            # Two bounds keep what is not seen at all finite; they are too wide to say anything.
            step = np.linalg.solve(A + np.diag([1e0, 1e0, 1e0, 0.0]), g)
            c = c + disc.E @ np.clip(step[:3], -_STEP_PX * c[2] / self.f, _STEP_PX * c[2] / self.f)
            delta += float(np.clip(step[3], -0.5, 0.5))
        disc = _Disc.of(c, radius, patch.x, patch.y)
        cov = np.linalg.inv(A + np.diag([1e0, 1e0, 1e0, 0.0]))
        across = (RIM_SD_PX * c[2] / self.f) ** 2
        cov_C = disc.E @ (cov[:3, :3] + np.diag([across, across, (3e-4) ** 2])) @ disc.E.T
        edge = np.abs(disc.rho - disc.rim) * self.f < RIM_PX / 2
        inside = disc.rho < disc.rim
        expected = np.pi * (disc.rim * self.f) ** 2
        shift, shift_cov = self._shift(patch, told, depths, c, radius, delta)
        return BallFit(
            c, cov_C, float((patch.colored & inside).sum() / expected), float((told & edge).sum() / max(edge.sum(), 1)),
            len(depths[0]), shift, shift_cov, delta, float(np.sqrt(cov[3, 3])),
        )  # fmt: skip

    def _rim(
        self, patch: Patch, told: np.ndarray, disc: _Disc, delta: float, width: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix (4, 4) and right-hand side (4,) of the rim for two metres across, one along, and the swelling [px]."""
        rise = (disc.rim + delta / self.f - disc.rho) * self.f / width
        on = told & (np.abs(rise) < 0.5)
        if not on.any():
            return np.zeros((4, 4)), np.zeros(4)
        rho, rise = disc.rho[on], rise[on]
        J = np.empty((len(rho), 4))
        per_m = self.f / (width * disc.D)
        J[:, 0], J[:, 1] = disc.a[on] / rho * per_m, disc.b[on] / rho * per_m
        J[:, 2], J[:, 3] = -disc.rim * per_m, 1.0 / width
        r = patch.colored[on] - 0.5 - rise
        # A wider rim has more pixels on it, each telling less: the same number of edges all the same.
        weight = RIM_PX / (width * PIXEL_SD**2) * (width / RIM_PX) ** 2
        return weight * (J.T @ J), weight * (J.T @ r)

    def _contradicting(self, patch: Patch, valid: np.ndarray, disc: _Disc) -> np.ndarray:
        """Pixels about colour well outside of the disc, and about none well inside of it: another thing is in the way."""
        px = 1.0 / self.f
        outside = patch.colored & (disc.rho > disc.rim + 2.0 * px) & (disc.rho < disc.rim + 5.0 * px)
        inside = ~patch.colored & valid & (disc.rho < disc.rim - 2.0 * px)
        # A single pixel is noise.
        wrong = _in_company(outside) | _in_company(inside)
        return grown(wrong, 2) if wrong.any() else wrong

    def _depths(self, patch: Patch, seen: np.ndarray, c: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the depths on the ball, those that differ from the rest left out."""
        disc = _Disc.of(c, radius, patch.zx, patch.zy)
        rows, columns = np.nonzero(seen & patch.known & (disc.rho < CORE * disc.rim))
        if not len(rows):
            return rows, columns
        off = patch.z[rows, columns] - ball_depth(patch.zx[rows, columns], patch.zy[rows, columns], c, radius)
        off = off - np.nanmedian(off)
        sd = float(c[2]) ** 2 * self.noise.sd + 0.05 * radius
        good = np.abs(off) < GATE_SD * sd
        rows, columns = rows[good], columns[good]
        every = max(int(np.ceil(len(rows) / DEPTHS)), 1)
        return rows[::every], columns[::every]

    def _along(self, patch: Patch, depths: tuple[np.ndarray, np.ndarray], c: np.ndarray, radius: float) -> np.ndarray:
        """The centre moved along its line of sight to where the depths have it."""
        if not len(depths[0]):
            return c
        off = patch.z[depths] - ball_depth(patch.zx[depths], patch.zy[depths], c, radius)
        move = float(np.nanmedian(off))
        return c * (1.0 + move / c[2]) if np.isfinite(move) else c

    def _lines(
        self, patch: Patch, depths: tuple[np.ndarray, np.ndarray], c: np.ndarray, radius: float, disc: _Disc
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Jacobian (n, 3) by metres across, across, along, residuals (n,) and covariance (n, n) of inverse depths."""
        x, y, z = patch.zx[depths], patch.zy[depths], patch.z[depths]
        model = ball_depth(x, y, c, radius)
        good = np.isfinite(model)
        rows, columns = depths[0][good], depths[1][good]
        x, y, z, model = x[good], y[good], z[good], model[good]
        ray = np.stack([x, y, np.ones_like(x)], axis=-1)
        n = (ray * model[:, None] - c) / radius
        slope = n / (n * ray).sum(axis=-1)[:, None]  # dz / dc
        J = (-slope / model[:, None] ** 2) @ disc.E
        r = 1.0 / z - 1.0 / model
        sideways = np.hypot(J[:, 0], J[:, 1]) * self.noise.sideways_px * model / self.f
        return J, r, self.noise.covariance(columns.astype(float), rows.astype(float), sideways**2)

    def _shift(
        self, patch: Patch, told: np.ndarray, depths: tuple[np.ndarray, np.ndarray], c: np.ndarray, radius: float,
        delta: float,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Lateral place by depth alone minus by colour alone [px], (2,) and (2, 2)."""
        nothing = np.full(2, np.nan), np.full((2, 2), np.nan)
        disc = _Disc.of(c, radius, patch.x, patch.y)
        A, g = self._rim(patch, told, disc, delta, RIM_PX)
        J, r, C = self._lines(patch, depths, c, radius, disc)
        if len(r) < 12:
            return nothing
        W = np.linalg.solve(C, np.column_stack([J, r]))
        B = J.T @ W[:, :3]
        if np.linalg.cond(B) > 1e8 or np.linalg.cond(A[:2, :2]) > 1e4:
            return nothing
        by_depth, by_color = np.linalg.solve(B, J.T @ W[:, 3]), np.linalg.solve(A[:2, :2], g[:2])
        cov = np.linalg.inv(B)[:2, :2] + np.linalg.inv(A[:2, :2])
        # The two axes across the line of sight as the picture's: u and v, but for the slant of a cap far off its middle.
        px = self.f / c[2]
        turn = disc.E[:2, :2]
        return turn @ (by_depth[:2] - by_color) * px, turn @ cov @ turn.T * px**2


def _in_company(pixels: np.ndarray) -> np.ndarray:
    """Pixels that have two others beside them."""
    import cv2

    if not pixels.any():
        return pixels
    count = cv2.boxFilter(pixels.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(pixels & (count >= 3))

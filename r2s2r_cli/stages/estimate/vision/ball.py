"""Where a ball of known radius is, from the pixels of its colour and the depths on it: Gauss-Newton, with covariance.

Across the line of sight the rim of the disc tells it, along the line the depths do. A ball about c is seen under the
cone of half angle asin(r / |c|) about c, so in slopes about the direction of c its rim is a circle wherever it lies in
the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.vision.blend import INNER, shares
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.patch import Patch, grown
from r2s2r_cli.stages.estimate.vision.solids import ball_depth

RIM_PX = 1.5
"""Width over which the modelled disc goes from 1 to 0."""
WIDE_PX = 3.0
"""The same in the first step, when its place is not certain to a pixel."""
PIXEL_SD = 0.32
"""What a pixel of the mask differs by from the modelled rim: 1 / sqrt(12) as it is yes or no, and colour noise."""
RIM_SD_PX2 = 0.7
"""Common error of the disc across the line of sight, times its radius [px^2]: uneven light, a rim that the range cuts
on one side. JPEG has colour in blocks of two pixels, so the rim of a small disc is known worse than its number of
pixels says: on tuning runs the whole error is 0.09 px where discs have a radius of 7 px and 0.14 px where they have 4.
Much of it lasts longer than the second for which the smoother takes it to be alike, so that more is stated."""
MASK_SD_PX = 0.35
"""The same where too little is seen to tell how much of a pixel is the ball: what lies beside moves a mask."""
CORE, FRAY_PX = 0.85, 1.5
"""Depths beyond this share of the disc's radius, or so close to its rim, are left out: edges fray."""
EDGES_PX, DEPTHS_ENOUGH = 2.2, 12
"""So close to the rim a depth may be one between ball and background. Where that leaves enough, it is left out too."""
DEPTHS = 64
"""Depths that are used at most; neighbours share most of their error, so more would tell nothing more."""
DEPTHS_LEAST = 5
"""Fewer depths on a ball could all be of something else: then only its colour counts."""
GATE_SD, GATE_RADII = 4.0, 0.05
"""A depth that differs from the median by more than these standard deviations and share of the radius is left out."""
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
        across = np.hypot(along[0], along[2])
        i, k = along[2] / across, -along[0] / across
        E = np.array([
            [i, along[1] * k, along[0]], [0.0, along[2] * i - along[0] * k, along[1]], [k, -along[1] * i, along[2]]
        ])  # fmt: skip
        q = x * along[0] + y * along[1] + along[2]
        a = (x * E[0, 0] + y * E[1, 0] + E[2, 0]) / q
        b = (x * E[0, 1] + y * E[1, 1] + E[2, 1]) / q
        return cls(E, D, a, b, np.hypot(a, b), radius / float(np.sqrt(max(D * D - radius**2, 1e-9))))


@dataclass(frozen=True)
class _Depths:
    """Depths on a ball: slopes x, y of their rays, z [m], (n,), and the inverse of the covariance of 1 / z (n, n)."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    weight: np.ndarray

    @classmethod
    def none(cls) -> _Depths:
        return cls(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)))


class BallFitter:
    """Fits balls; what it knows of the camera stays the same for all of them.

    f: focal length [px]. noise: of depth. swell_px, swell_sd_px: by how much the discs look larger, and how well that
    is known.
    """

    def __init__(self, f: float, noise: DepthNoise, swell_px: float, swell_sd_px: float) -> None:
        self.f, self.noise = f, noise
        self.swell_px, self.swell_sd_px = swell_px, swell_sd_px

    def place(
        self,
        patch: Patch,
        told: np.ndarray,
        about: Patch,
        hidden: np.ndarray,
        center: np.ndarray,
        radius: float,
        reach_px: float,
    ) -> np.ndarray:
        """A start within a pixel [m] (3,): `center`, moved to where the colour fits what should be seen.

        told: pixels of the patch whose colour tells something. about: the part of the patch that a ball at `center`
        covers; hidden: its pixels where something is before that ball; it moves with the ball, as the rod behind it
        does. Both bool (v, u). reach_px: three standard deviations of the prediction; the start is no farther off, and
        of two places that fit equally well it is the nearer. The distance stays.
        """
        import cv2

        disc = _Disc.of(center, radius, about.x, about.y)
        model = np.clip(0.5 + (disc.rim + self.swell_px / self.f - disc.rho) * self.f, 0.0, 1.0) * ~hidden
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
        move = np.array([du[i], dv[k], 0.0]) * center[2] / self.f
        return np.asarray(center + move)

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
        start = c = self._along(patch, seen, center, radius)
        delta = self.swell_px
        told, depths, share = valid, _Depths.none(), patch.colored
        for k in range(_STEPS):
            disc = _Disc.of(c, radius, patch.x, patch.y)
            if k == 1:
                share = self._share(patch, valid, disc)
                told = valid & ~self._contradicting(share, valid, disc)
                depths = self._depths(patch, seen, c, radius, disc)
            rim, pull = self._rim(share, told, disc, delta, RIM_PX if k else WIDE_PX)
            line, draw = self._lines(depths, c, radius, disc)
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

    def _rim(
        self, share: np.ndarray, told: np.ndarray, disc: _Disc, delta: float, width: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix (4, 4) and right-hand side (4,) of the rim: metres across, across, along, px swelling."""
        rise = (disc.rim + delta / self.f - disc.rho) * self.f / width
        on = told & (np.abs(rise) < 0.5)
        if not on.any():
            return np.zeros((4, 4)), np.zeros(4)
        rho, rise = disc.rho[on], rise[on]
        J = np.empty((len(rho), 4))
        per_m = self.f / (width * disc.D)
        J[:, 0], J[:, 1] = disc.a[on] / rho * per_m, disc.b[on] / rho * per_m
        J[:, 2], J[:, 3] = -disc.rim * per_m, 1.0 / width
        r = share[on] - 0.5 - rise
        # A wider rim has more pixels on it, each telling less: the same number of edges all the same.
        weight = RIM_PX / (width * PIXEL_SD**2) * (width / RIM_PX) ** 2
        return weight * (J.T @ J), weight * (J.T @ r)

    def _share(self, patch: Patch, valid: np.ndarray, disc: _Disc) -> np.ndarray:
        """How much of each pixel is the ball; by the mask alone where little of the ball is seen."""
        inside = valid & patch.colored & (disc.rho < INNER * disc.rim)
        found = shares(patch.color, inside, disc.a / disc.rim, disc.b / disc.rim, disc.rim * self.f)
        return patch.colored if found is None else found

    def _contradicting(self, share: np.ndarray, valid: np.ndarray, disc: _Disc) -> np.ndarray:
        """Pixels about colour well outside of the disc, and about none well inside: another thing is in the way."""
        px = 1.0 / self.f
        colored = share > 0.5
        outside = colored & (disc.rho > disc.rim + 2.0 * px) & (disc.rho < disc.rim + 5.0 * px)
        inside = ~colored & valid & (disc.rho < disc.rim - 2.0 * px)
        # A single pixel is noise.
        wrong = _in_company(outside) | _in_company(inside)
        return grown(wrong, 2) if wrong.any() else wrong

    def _depths(self, patch: Patch, seen: np.ndarray, c: np.ndarray, radius: float, disc: _Disc) -> _Depths:
        """The depths on the ball, those that differ from the rest left out."""
        rho = _Disc.of(c, radius, patch.zx, patch.zy).rho
        on = seen & patch.known & (rho < self._core(disc, FRAY_PX))
        if (inner := on & (rho < self._core(disc, EDGES_PX))).sum() >= DEPTHS_ENOUGH:
            on = inner
        rows, columns = np.nonzero(on)
        if len(rows) < DEPTHS_LEAST:
            return _Depths.none()
        x, y, z = patch.zx[rows, columns], patch.zy[rows, columns], patch.z[rows, columns]
        off = z - ball_depth(x, y, c, radius)
        good = np.abs(off - np.median(off)) < GATE_SD * (float(c[2]) ** 2 * self.noise.sd) + GATE_RADII * radius
        every = max(int(np.ceil(good.sum() / DEPTHS)), 1)
        pick = np.nonzero(good)[0][::every]
        if len(pick) < DEPTHS_LEAST:
            return _Depths.none()
        x, y, z = x[pick], y[pick], z[pick]
        slope = _slopes(x, y, c, radius, self.noise.sideways_px / self.f)
        if slope is None:
            return _Depths.none()
        model, J = slope
        sideways = np.hypot(*(J @ disc.E)[:, :2].T) * self.noise.sideways_px * model / self.f
        C = self.noise.covariance(columns[pick].astype(float), rows[pick].astype(float), sideways**2)
        return _Depths(x, y, z, np.linalg.inv(C))

    def _core(self, disc: _Disc, fray_px: float) -> float:
        """Radius of the part of the disc whose depths are used, as a slope."""
        return min(CORE * disc.rim, max(disc.rim - fray_px / self.f, 0.45 * disc.rim))

    def _along(self, patch: Patch, seen: np.ndarray, c: np.ndarray, radius: float) -> np.ndarray:
        """The centre moved along its line of sight to where the depths have it."""
        off = patch.z - ball_depth(patch.zx, patch.zy, c, radius)
        off = off[seen & patch.known & np.isfinite(off)]
        return c * (1.0 + float(np.median(off)) / c[2]) if len(off) >= DEPTHS_LEAST else c

    def _lines(self, depths: _Depths, c: np.ndarray, radius: float, disc: _Disc) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix (3, 3) and right-hand side (3,) of the depths, for metres across, across and along."""
        found = _slopes(depths.x, depths.y, c, radius, self.noise.sideways_px / self.f) if len(depths.z) else None
        if found is None:
            return np.zeros((3, 3)), np.zeros(3)
        model, J = found[0], found[1] @ disc.E
        weighted = J.T @ depths.weight
        return weighted @ J, weighted @ (1.0 / depths.z - 1.0 / model)

    def _shift(
        self, disc: _Disc, rim: np.ndarray, pull: np.ndarray, line: np.ndarray, draw: np.ndarray
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


def _slopes(
    x: np.ndarray, y: np.ndarray, c: np.ndarray, radius: float, sideways: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Depths [m] (n,) that rays on a ball report on average, and d(1 / z) / dc [1/m^2] (n, 3); None if one misses.

    sideways: standard deviation by which a ray misses its pixel, as a slope. A ball curves away on all sides, so that
    what is seen there lies behind by half the variance times the Laplacian of its surface, (r^2 + q^2) / q^3 at a
    depth q before its middle.
    """
    z = ball_depth(x, y, c, radius)
    if not np.isfinite(z).all():
        return None
    ray = np.stack([x, y, np.ones_like(x)], axis=-1)
    n = ray * z[:, None] - c
    facing = -(n * ray).sum(axis=-1)
    q = np.maximum(facing / np.sqrt((ray * ray).sum(axis=-1)), 0.4 * radius)
    model = z + 0.5 * (sideways * z) ** 2 * (radius**2 + q**2) / q**3
    return model, n / (facing * z**2)[:, None]


def _in_company(pixels: np.ndarray) -> np.ndarray:
    """Pixels that have two others beside them."""
    import cv2

    if not pixels.any():
        return pixels
    count = cv2.boxFilter(pixels.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(pixels & (count >= 3))

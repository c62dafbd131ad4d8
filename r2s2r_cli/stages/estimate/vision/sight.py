"""The tracker's eyes: caps seen where they are predicted, and caps found where nothing is predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.vision.ball import BallFit, BallFitter
from r2s2r_cli.stages.estimate.vision.colors import blank, hsv_of, mask, ranges_of
from r2s2r_cli.stages.estimate.vision.depths import DEPTHS_LEAST
from r2s2r_cli.stages.estimate.vision.detect import balls, candidates
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.patch import Patch, in_front
from r2s2r_cli.stages.estimate.vision.sightings import (
    COLOR_ONLY,
    DOUBTFUL,
    HIDDEN,
    NO_PICTURE,
    OUT_OF_VIEW,
    SEEN,
    Candidate,
    Sightings,
)
from r2s2r_cli.stages.estimate.vision.solids import Body, ball_depth
from r2s2r_cli.stages.estimate.vision.start_place import start_place
from schemas.robot import Robot

GATE_SD = 3.0
REACH_M, REACH_PX = 0.025, 40.0
"""A cap is looked for within GATE_SD standard deviations of its prediction, REACH_M at least: motors start and
stop between frames. And no farther than REACH_PX."""
LEAST_PIXELS = 6
LEAST_VISIBLE, LEAST_RIM = 0.12, 0.12
SD_MOST_M = 0.03
"""A sighting across the line of sight worse than this says nothing."""
FAR_SD = 5.0
"""Depths that differ from the prediction by more than GATE_SD of its own standard deviations and these of a depth are
of something else."""
FAR_SD_M = 0.005
"""A predicted distance is not taken for better than this where nothing else tells it."""
STRAY_PX = 2.0
"""A fit that ends farther outside of where it was looked for has gone to something else."""
EDGE_PX = 0.7
"""What hides a cap is taken for larger by this: pixels on its edge may be of either."""
MOVED_PX = 2.0
"""A prediction that was wrong by more: what hides what is worked out again from what was seen."""
LOW_M = 0.015
"""A cap's centre is its radius above the ground; lower than that by this and its uncertainty, it is no cap."""


@dataclass(frozen=True)
class Pictures:
    """One frame, made ready. color: RGB (v, u, 3). z [m] (v, u), 0 where unknown. index: of the frame."""

    index: int
    color: np.ndarray
    z: np.ndarray


@dataclass(frozen=True)
class Seen:
    """A cap in a frame: why it is seen or not, its fit if it is, and whether parts of the robot are in its way."""

    code: int
    fit: BallFit | None = None
    crowded: bool = False


class Sighter:
    """Sees the caps of a robot in frames of one camera.

    robot: colours, cap radii, and the parts that hide caps. survey: what is known about the camera (`survey.survey`).
    Raises InputError for a rod without colour.
    """

    def __init__(self, robot: Robot, lens: Intrinsics, depth_scale: float, survey: Survey) -> None:
        self.survey = survey
        self.rods = len(robot.rods)
        self.rod_length = np.array([rod.length_m for rod in robot.rods])
        self.ranges = ranges_of(robot)
        self._body = Body(robot)
        self.cap_radius = self._body.cap_radius
        self._scale = depth_scale
        self.lens = Lens(lens)
        self._depth_lens = self.lens
        if any(survey.shift_px):
            du, dv = survey.shift_px
            self._depth_lens = Lens(Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.cx + du, lens.cy + dv,
                                               lens.distortion))  # fmt: skip
        self._f = float(np.sqrt(lens.fx * lens.fy))
        self._fitter = BallFitter(self._f, survey.noise, survey.swell_px, survey.swell_sd_px)

    def sight(self, frame: ImageFrame, p_C: np.ndarray, cov_C: np.ndarray) -> Sightings:
        """Look for every cap where it is predicted.

        p_C: predicted centres in frame C [m] (cap, 3); cov_C: their covariance [m^2] (cap, 3, 3); both tell where to
        look and what hides what, and do not enter the result. Raises InputError for pictures that are not of this
        camera's size and type.
        """
        pictures = self._ready(frame)
        caps = len(p_C)
        if pictures is None:
            return _nothing(caps, NO_PICTURE)
        sd = np.sqrt(np.clip(np.trace(cov_C, axis1=1, axis2=2), 0.0, None))
        p = np.array(p_C, dtype=float)
        found = [self.one(pictures, cap, p, sd) for cap in range(caps)]
        moved = False
        for cap, seen in enumerate(found):
            if seen.fit is not None:
                moved |= self._px(seen.fit.center - p[cap], seen.fit.center) > MOVED_PX
                p[cap], sd[cap] = seen.fit.center, np.sqrt(np.trace(seen.fit.cov))
        if moved:
            found = [self.one(pictures, cap, p, sd) if seen.crowded else seen for cap, seen in enumerate(found)]
        return self._sightings(found)

    def detect(self, frame: ImageFrame) -> tuple[Candidate, ...]:
        """Caps found without prediction, those of each rod best first; there may be more or fewer than two a rod.

        Raises InputError for pictures that are not of this camera's size and type.
        """
        return candidates(self.balls(frame))

    def balls(self, frame: ImageFrame) -> list[list[BallFit]]:
        """What `detect` finds, by rod, with all that the fits tell."""
        pictures = self._ready(frame)
        return [[] for _ in range(self.rods)] if pictures is None else balls(self, pictures)

    def _ready(self, frame: ImageFrame) -> Pictures | None:
        """The frame's pictures, None where there is no colour to be seen."""
        size = (self.lens.height, self.lens.width)
        if frame.color is None:
            return None
        _check(frame.color, (*size, 3), np.uint8, "colour", frame.index)
        if blank(frame.color):
            return None
        z = np.zeros(size)
        if frame.depth is not None:
            _check(frame.depth, size, np.uint16, "depth", frame.index)
            z = frame.depth * self._scale
        return Pictures(frame.index, frame.color, z)

    def floor_depth(self, ray: np.ndarray) -> float | None:
        """Depth z [m] at which a ray (x, y, 1) meets the ground; None where it does not, or no ground is known."""
        ground = self.survey.ground
        inverse = float(ground.inverse_depth(ray[0], ray[1])) if ground is not None else 0.0
        return 1.0 / inverse if inverse > 0 else None

    def patch(self, pictures: Pictures, rod: int, center: np.ndarray, reach_px: float) -> Patch | None:
        """The pixels within reach of a point of frame C; None where none of them is in the picture."""
        u, v = self.lens.project(center)
        r = reach_px
        u0, u1 = int(np.clip(np.floor(u - r), 0, self.lens.width)), int(np.clip(np.ceil(u + r), 0, self.lens.width))
        v0, v1 = int(np.clip(np.floor(v - r), 0, self.lens.height)), int(np.clip(np.ceil(v + r), 0, self.lens.height))
        if u1 - u0 < 3 or v1 - v0 < 3:
            return None
        area = (slice(v0, v1), slice(u0, u1))
        z = pictures.z[area]
        color = np.ascontiguousarray(pictures.color[area])
        colored = mask(hsv_of(color), self.ranges[rod])
        return Patch(
            self.lens.x[area], self.lens.y[area], colored, z > 0, z, self._depth_lens.x[area],
            self._depth_lens.y[area], color, u0, v0,
        )  # fmt: skip

    def _patch_about(self, patch: Patch, center: np.ndarray, reach_px: float) -> Patch | None:
        """The part of a patch within reach of a point; None where nothing of it is."""
        u, v = self.lens.project(center)
        u0, u1 = max(int(np.floor(u - reach_px)) - patch.u0, 0), int(np.ceil(u + reach_px)) - patch.u0
        v0, v1 = max(int(np.floor(v - reach_px)) - patch.v0, 0), int(np.ceil(v + reach_px)) - patch.v0
        return patch.part(slice(v0, max(v1, v0)), slice(u0, max(u1, u0)))

    def _px(self, off: np.ndarray, center: np.ndarray) -> float:
        """Length across the line of sight [px] of a difference of points [m] near `center`."""
        along = center / np.linalg.norm(center)
        return float(np.linalg.norm(off - (off @ along) * along) * self._f / center[2])

    def one(self, pictures: Pictures, cap: int, p_C: np.ndarray, sd: np.ndarray) -> Seen:
        """Code and fit of one cap; p_C, sd: of all caps, those of the others for what hides it."""
        center, radius = p_C[cap], float(self.cap_radius[cap])
        if not (np.isfinite(center).all() and center[2] > 3 * radius):
            return Seen(OUT_OF_VIEW)
        disc_px = self._f * radius / center[2]
        spare = float(min(max(GATE_SD * sd[cap], REACH_M) * self._f / center[2], REACH_PX))
        patch = self.patch(pictures, cap // 2, center, 1.3 * disc_px + spare + 4.0)
        if patch is None:
            return Seen(OUT_OF_VIEW)
        if int(patch.colored.sum()) < LEAST_PIXELS:
            return Seen(HIDDEN)
        margin = np.minimum(sd / np.sqrt(3.0), 0.01) + EDGE_PX * center[2] / self._f
        margin[cap] = EDGE_PX * center[2] / self._f
        far = max(GATE_SD * float(sd[cap]), REACH_M) + FAR_SD * float(self._noise_sd(center[2])) + radius
        start = self._start(patch, p_C, cap, margin, spare)
        start = start * (self._distance(patch, start, radius, far) / start[2])
        close = self._patch_about(patch, start, 1.2 * disc_px + 6.0)
        if close is None:
            return Seen(OUT_OF_VIEW)
        patch = close
        moved = p_C.copy()
        moved[cap] = start
        own = ball_depth(patch.x, patch.y, start, radius)
        z_cap = np.where(np.isfinite(own), own, start[2])
        model = self._body.nearest(patch.x, patch.y, moved, cap, margin) < z_cap
        valid = ~(model | in_front(patch, z_cap, self._noise_sd(z_cap)))
        seen = moved_by(patch.colored & valid, self.survey.shift_px)
        seen &= np.abs(patch.z - center[2]) < far
        twin = self._twin(patch, moved, cap, margin)
        if twin is not None:
            patch, valid = replace(patch, colored=patch.colored & ~twin), valid & ~twin
        fit = self._fitter.fit(patch, valid, seen, start, radius,
                               far=float(np.linalg.norm(center)), far_sd=max(float(sd[cap]), FAR_SD_M))  # fmt: skip
        if self._px(fit.center - center, center) > spare + STRAY_PX:
            return Seen(DOUBTFUL)
        return self._judged(cap, fit, bool((model & np.isfinite(own)).any()))

    def _noise_sd(self, z: np.ndarray | float) -> np.ndarray:
        """Of depths z [m]."""
        return np.asarray(np.square(z) * self.survey.noise.sd)

    def _start(self, patch: Patch, p_C: np.ndarray, cap: int, margin: np.ndarray, reach_px: float) -> np.ndarray:
        """Where the colour fits best what should be seen of a cap, at the predicted distance [m] (3,)."""
        center, radius = p_C[cap], float(self.cap_radius[cap])
        about = self._patch_about(patch, center, 1.1 * self._f * radius / center[2] + 2.0)
        if about is None:
            return center
        own = ball_depth(about.x, about.y, center, radius)
        hidden = self._body.nearest(about.x, about.y, p_C, cap, 0.0 * margin) < np.where(
            np.isfinite(own), own, center[2]
        )
        told = ~in_front(patch, np.full_like(patch.z, center[2] - radius), self._noise_sd(center[2]))
        twin = self._twin(patch, p_C, cap, margin)
        return start_place(
            patch, told if twin is None else told & ~twin, about, hidden, center, radius, reach_px, f=self._f,
            swell_px=self.survey.swell_px,
        )  # fmt: skip

    def _twin(self, patch: Patch, p_C: np.ndarray, cap: int, margin: np.ndarray) -> np.ndarray | None:
        """Pixels beside a cap, or before it, that may show its rod's other cap, which has its colour; None: none."""
        center, radius = p_C[cap ^ 1], float(self.cap_radius[cap ^ 1] + margin[cap ^ 1])
        if not center[2] > 2 * radius:
            return None
        u, v = self.lens.project(center) - (patch.u0, patch.v0)
        reach, (high, wide) = 1.3 * self._f * radius / center[2], patch.x.shape
        if not (-reach < u < wide + reach and -reach < v < high + reach):
            return None
        z = ball_depth(patch.x, patch.y, center, radius)
        own = ball_depth(patch.x, patch.y, p_C[cap], float(self.cap_radius[cap]))
        return np.asarray(np.isfinite(z) & ~(own < z))

    def _distance(self, patch: Patch, center: np.ndarray, radius: float, far: float) -> float:
        """Z of the centre [m] by the depths in its disc; that of `center` where there are none."""
        off = patch.z - ball_depth(patch.zx, patch.zy, center, radius)
        on = patch.known & patch.colored & (np.abs(off) < far)
        return float(center[2] + np.median(off[on])) if on.sum() >= 2 * DEPTHS_LEAST else float(center[2])

    def _judged(self, cap: int, fit: BallFit, crowded: bool) -> Seen:
        """What a fit is worth."""
        if fit.visible < LEAST_VISIBLE:
            return Seen(HIDDEN, crowded=crowded)
        along = fit.center / np.linalg.norm(fit.center)
        across = np.trace(fit.cov) - along @ fit.cov @ along
        if fit.rim < LEAST_RIM or not 0 <= across < SD_MOST_M**2 or fit.visible > 1.5:
            return Seen(DOUBTFUL, crowded=crowded)
        ground = self.survey.ground
        if ground is not None and fit.depths >= DEPTHS_LEAST:
            low = self.cap_radius[cap] - float(ground.height(fit.center))
            if low > LOW_M + 4 * np.sqrt(ground.normal_C @ fit.cov @ ground.normal_C):
                return Seen(DOUBTFUL, crowded=crowded)
        return Seen(SEEN if fit.depths >= DEPTHS_LEAST else COLOR_ONLY, fit, crowded)

    def _sightings(self, found: list[Seen]) -> Sightings:
        caps = len(found)
        p, cov = np.full((caps, 3), np.nan), np.full((caps, 3, 3), np.nan)
        visible, code = np.zeros(caps), np.zeros(caps, dtype=np.uint8)
        weight, total = np.zeros((2, 2)), np.zeros(2)
        for cap, seen in enumerate(found):
            code[cap], fit = seen.code, seen.fit
            if fit is None:
                continue
            p[cap], cov[cap], visible[cap] = fit.center, fit.cov, min(fit.visible, 1.0)
            if np.isfinite(fit.shift_px).all():
                W = np.linalg.inv(fit.shift_cov_px)
                weight, total = weight + W, total + W @ fit.shift_px
        if not weight.any():
            return Sightings(p, cov, visible, code)
        shift_cov = np.linalg.inv(weight)
        return Sightings(p, cov, visible, code, shift_cov @ total, shift_cov)


def moved_by(colored: np.ndarray, shift_px: tuple[float, float]) -> np.ndarray:
    """The coloured pixels, moved to where the depth picture has them."""
    du, dv = (round(shift) for shift in shift_px)
    if du == dv == 0:
        return colored
    moved = np.zeros_like(colored)
    h, w = colored.shape
    moved[max(dv, 0) : h + min(dv, 0), max(du, 0) : w + min(du, 0)] = colored[
        max(-dv, 0) : h + min(-dv, 0), max(-du, 0) : w + min(-du, 0)
    ]
    return moved


def _nothing(caps: int, code: int) -> Sightings:
    return Sightings(
        np.full((caps, 3), np.nan), np.full((caps, 3, 3), np.nan), np.zeros(caps), np.full(caps, code, dtype=np.uint8)
    )


def _check(picture: np.ndarray, shape: tuple[int, ...], kind: type, name: str, index: int) -> None:
    if picture.shape != shape or picture.dtype != kind:
        raise InputError(
            f"a {name} picture is not one of this camera",
            where=f"frame {index}",
            expected=f"{np.dtype(kind)} {shape}",
            received=f"{picture.dtype} {picture.shape}",
            hint="r2s2r doctor camera --camera replay:10-record.h5",
        )

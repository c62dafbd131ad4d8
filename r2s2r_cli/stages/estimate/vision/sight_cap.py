"""One cap of a robot in a frame: looked for where it is predicted, fitted, and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.ball import BallFit, BallFitter
from r2s2r_cli.stages.estimate.vision.colors import ranges_of
from r2s2r_cli.stages.estimate.vision.depths import DEPTHS_LEAST
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.patch import Patch, in_front
from r2s2r_cli.stages.estimate.vision.sightings import COLOR_ONLY, DOUBTFUL, HIDDEN, OUT_OF_VIEW, SEEN
from r2s2r_cli.stages.estimate.vision.solids import Body, ball_depth
from r2s2r_cli.stages.estimate.vision.start_place import start_place
from r2s2r_cli.stages.estimate.vision.view import Pictures, View
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
LOW_M = 0.015
"""A cap's centre is its radius above the ground; lower than that by this and its uncertainty, it is no cap."""


@dataclass(frozen=True)
class Seen:
    """A cap in a frame: why it is seen or not, its fit if it is, and whether parts of the robot are in its way."""

    code: int
    fit: BallFit | None = None
    crowded: bool = False


class CapSighter:
    """Sees single caps of a robot in frames of one camera; arguments as of `sight.Sighter`.

    Raises InputError for a rod without colour.
    """

    def __init__(self, robot: Robot, lens: Intrinsics, depth_scale: float, survey: Survey) -> None:
        self.survey = survey
        self.rods = len(robot.rods)
        self.rod_length = np.array([rod.length_m for rod in robot.rods])
        self.ranges = ranges_of(robot)
        self._body = Body(robot)
        self.cap_radius = self._body.cap_radius
        self.view = View(lens, depth_scale, survey.shift_px)
        self._fitter = BallFitter(self.view.f, survey.noise, survey.swell_px, survey.swell_sd_px)

    def one(self, pictures: Pictures, cap: int, p_C: np.ndarray, sd: np.ndarray) -> Seen:
        """Code and fit of one cap; p_C, sd: of all caps, those of the others for what hides it."""
        center, radius = p_C[cap], float(self.cap_radius[cap])
        if not (np.isfinite(center).all() and center[2] > 3 * radius):
            return Seen(OUT_OF_VIEW)
        disc_px = self.view.f * radius / center[2]
        spare = float(min(max(GATE_SD * sd[cap], REACH_M) * self.view.f / center[2], REACH_PX))
        patch = self.view.patch(pictures, self.ranges[cap // 2], center, 1.3 * disc_px + spare + 4.0)
        if patch is None:
            return Seen(OUT_OF_VIEW)
        if int(patch.colored.sum()) < LEAST_PIXELS:
            return Seen(HIDDEN)
        margin = np.minimum(sd / np.sqrt(3.0), 0.01) + EDGE_PX * center[2] / self.view.f
        margin[cap] = EDGE_PX * center[2] / self.view.f
        far = max(GATE_SD * float(sd[cap]), REACH_M) + FAR_SD * float(self._noise_sd(center[2])) + radius
        start = self._start(patch, p_C, cap, margin, spare)
        start = start * (self._distance(patch, start, radius, far) / start[2])
        close = self.view.about(patch, start, 1.2 * disc_px + 6.0)
        if close is None:
            return Seen(OUT_OF_VIEW)
        patch = close
        moved = p_C.copy()
        moved[cap] = start
        own = ball_depth(patch.x, patch.y, start, radius)
        z_cap = np.where(np.isfinite(own), own, start[2])
        model = self._body.nearest(patch.x, patch.y, moved, cap, margin) < z_cap
        valid = ~(model | in_front(patch, z_cap, self._noise_sd(z_cap)))
        seen = self.view.where_depth_is(patch.colored & valid)
        seen &= np.abs(patch.z - center[2]) < far
        twin = self._twin(patch, moved, cap, margin)
        if twin is not None:
            patch, valid = replace(patch, colored=patch.colored & ~twin), valid & ~twin
        fit = self._fitter.fit(patch, valid, seen, start, radius,
                               far=float(np.linalg.norm(center)), far_sd=max(float(sd[cap]), FAR_SD_M))  # fmt: skip
        if self.view.px(fit.center - center, center) > spare + STRAY_PX:
            return Seen(DOUBTFUL)
        return self._judged(cap, fit, bool((model & np.isfinite(own)).any()))

    def _noise_sd(self, z: np.ndarray | float) -> np.ndarray:
        """Of depths z [m]."""
        return np.asarray(np.square(z) * self.survey.noise.sd)

    def _start(self, patch: Patch, p_C: np.ndarray, cap: int, margin: np.ndarray, reach_px: float) -> np.ndarray:
        """Where the colour fits best what should be seen of a cap, at the predicted distance [m] (3,)."""
        center, radius = p_C[cap], float(self.cap_radius[cap])
        about = self.view.about(patch, center, 1.1 * self.view.f * radius / center[2] + 2.0)
        if about is None:
            return center
        own = ball_depth(about.x, about.y, center, radius)
        hidden = self._body.nearest(about.x, about.y, p_C, cap, 0.0 * margin) < np.where(
            np.isfinite(own), own, center[2]
        )
        told = ~in_front(patch, np.full_like(patch.z, center[2] - radius), self._noise_sd(center[2]))
        twin = self._twin(patch, p_C, cap, margin)
        return start_place(
            patch, told if twin is None else told & ~twin, about, hidden, center, radius, reach_px, f=self.view.f,
            swell_px=self.survey.swell_px,
        )  # fmt: skip

    def _twin(self, patch: Patch, p_C: np.ndarray, cap: int, margin: np.ndarray) -> np.ndarray | None:
        """Pixels beside a cap, or before it, that may show its rod's other cap, which has its colour; None: none."""
        center, radius = p_C[cap ^ 1], float(self.cap_radius[cap ^ 1] + margin[cap ^ 1])
        if not center[2] > 2 * radius:
            return None
        u, v = self.view.lens.project(center) - (patch.u0, patch.v0)
        reach, (high, wide) = 1.3 * self.view.f * radius / center[2], patch.x.shape
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

    def floor_depth(self, ray: np.ndarray) -> float | None:
        """Depth z [m] at which a ray (x, y, 1) meets the ground; None where it does not, or no ground is known."""
        ground = self.survey.ground
        inverse = float(ground.inverse_depth(ray[0], ray[1])) if ground is not None else 0.0
        return 1.0 / inverse if inverse > 0 else None

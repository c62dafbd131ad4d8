"""The tracker's eyes: caps seen where they are predicted, and caps found where nothing is predicted."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.ball import BallFit
from r2s2r_cli.stages.estimate.vision.detect import balls, candidates
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.sight_cap import CapSighter, Seen
from r2s2r_cli.stages.estimate.vision.sightings import NO_PICTURE, Candidate, Sightings
from schemas.robot import Robot

MOVED_PX = 2.0
"""A prediction that was wrong by more: what hides what is worked out again from what was seen."""


class Sighter:
    """Sees the caps of a robot in frames of one camera.

    robot: colours, cap radii, and the parts that hide caps. survey: what is known about the camera (`survey.survey`).
    Raises InputError for a rod without colour.
    """

    def __init__(self, robot: Robot, lens: Intrinsics, depth_scale: float, survey: Survey) -> None:
        self._caps = CapSighter(robot, lens, depth_scale, survey)

    @property
    def lens(self) -> Lens:
        """The camera's, in colour."""
        return self._caps.view.lens

    def sight(self, frame: ImageFrame, p_C: np.ndarray, cov_C: np.ndarray) -> Sightings:
        """Look for every cap where it is predicted.

        p_C: predicted centres in frame C [m] (cap, 3); cov_C: their covariance [m^2] (cap, 3, 3); both tell where to
        look and what hides what, and do not enter the result. Raises InputError for pictures that are not of this
        camera's size and type.
        """
        pictures = self._caps.view.ready(frame)
        caps = len(p_C)
        if pictures is None:
            return _nothing(caps, NO_PICTURE)
        sd = np.sqrt(np.clip(np.trace(cov_C, axis1=1, axis2=2), 0.0, None))
        p = np.array(p_C, dtype=float)
        found = [self._caps.one(pictures, cap, p, sd) for cap in range(caps)]
        moved = False
        for cap, seen in enumerate(found):
            if seen.fit is not None:
                moved |= self._caps.view.px(seen.fit.center - p[cap], seen.fit.center) > MOVED_PX
                p[cap], sd[cap] = seen.fit.center, np.sqrt(np.trace(seen.fit.cov))
        if moved:
            found = [self._caps.one(pictures, cap, p, sd) if seen.crowded else seen for cap, seen in enumerate(found)]
        return _together(found)

    def detect(self, frame: ImageFrame) -> tuple[Candidate, ...]:
        """Caps found without prediction, those of each rod best first; there may be more or fewer than two a rod.

        Raises InputError for pictures that are not of this camera's size and type.
        """
        return candidates(self.balls(frame))

    def balls(self, frame: ImageFrame) -> list[list[BallFit]]:
        """What `detect` finds, by rod, with all that the fits tell."""
        pictures = self._caps.view.ready(frame)
        return [[] for _ in range(self._caps.rods)] if pictures is None else balls(self._caps, pictures)


def _together(found: list[Seen]) -> Sightings:
    """All caps of a frame, with the mean over them of what depth and colour differ by."""
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


def _nothing(caps: int, code: int) -> Sightings:
    return Sightings(
        np.full((caps, 3), np.nan), np.full((caps, 3, 3), np.nan), np.zeros(caps), np.full(caps, code, dtype=np.uint8)
    )

"""The whole run at once: states, covariances, sensor offsets, clock, floor and contacts from stored sightings."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, Sighted, TrackedRun
from schemas.robot import Robot


def smooth_run(
    sighted: Sighted,
    readings: Readings | None,
    robot: Robot,
    settings: MotionSettings | None = None,
    *,
    switches: np.ndarray | None = None,
) -> TrackedRun:
    """Maximum of the posterior over all frames, and its covariance.

    switches: gaps between frames (index k: between k and k + 1) in which a motor was switched, shape (any,).
    Raises InputError where no frame has all caps sighted to start from; NumericalError where the search fails.
    """
    raise NotImplementedError

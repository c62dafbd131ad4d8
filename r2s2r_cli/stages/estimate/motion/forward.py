"""The causal filter: where the caps are in the next image, and how sure that is."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from schemas.robot import Robot


class Forward:
    """Extended Kalman filter of all caps, cable sensors' offsets included. Times may also run backwards.

    Order of calls: `start`, then for every image `sense` with the newest lengths (any number of times), `predict`,
    `update`. Positions in W [m].
    """

    def __init__(self, robot: Robot, settings: MotionSettings | None = None) -> None:
        raise NotImplementedError

    def start(self, t: float, p_WE: np.ndarray, cov: np.ndarray | None = None) -> None:
        """Begin (again) at rest at labelled caps, shape (cap, 3); cov: (cap, 3, 3) [m^2], default 5 mm an axis."""
        raise NotImplementedError

    def predict(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Go to time t [s]; caps (cap, 3) and their covariance (cap, 3, 3) there."""
        raise NotImplementedError

    def update(self, t: float, p_WE: np.ndarray, cov: np.ndarray) -> np.ndarray:
        """Take in sightings at time t: (cap, 3), NaN where there is none, and (cap, 3, 3). Which were used: (cap,)."""
        raise NotImplementedError

    def sense(self, t: float, length: np.ndarray) -> None:
        """Take in sensor lengths at time t [m], shape (sensor,), NaN where there is none."""
        raise NotImplementedError

    @property
    def lost(self) -> bool:
        """Some cap is less certain than `MotionSettings.lost_sd_m`, or sightings were refused for long: look everywhere
        (`reacquire`)."""
        raise NotImplementedError

    def reacquire(self, t: float, candidates: list[np.ndarray], cov: np.ndarray) -> bool:
        """Find the caps among blobs of each rod's colour, (blob, 3) in W with covariance (3, 3), by the labelling that
        fits prediction and sensors best; whether one did, the filter then goes on from there."""
        raise NotImplementedError

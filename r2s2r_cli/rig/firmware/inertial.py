"""The inertial unit of a board: specific force, angular velocity, and the attitude that older firmware reckons."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.model.frames import rotation
from r2s2r_cli.rig.world.device import Inertial

GRAVITY = 9.81
"""[m/s^2], as in the rig's model."""


class InertialUnit:
    """At the middle of a rod, axes R. Specific force is the mean since the last reading, as a filtered one is."""

    def __init__(self, settings: Inertial, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings, rng
        self._accel_bias = settings.accel_bias_sd_m_per_s2 * rng.standard_normal(3)
        self._gyro_bias = settings.gyro_bias_sd_rad_per_s * rng.standard_normal(3)
        self._t: float | None = None
        self._v = np.zeros(3)

    def read(
        self, t: float, q_WR: np.ndarray, v_WR: np.ndarray, w_R: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(a_B [m/s^2], w_WB [rad/s], both in axes R, (3,), q_WB xyzw) from attitude (xyzw), velocity in W [m/s] and
        angular velocity in R [rad/s]."""
        s, rng = self._settings, self._rng
        a_W = np.zeros(3) if self._t is None or t <= self._t else (v_WR - self._v) / (t - self._t)
        self._t, self._v = t, v_WR.copy()
        a_B = rotation(q_WR).T @ (a_W + np.array([0.0, 0.0, GRAVITY]))
        a_B = a_B + self._accel_bias + s.accel_noise_sd_m_per_s2 * rng.standard_normal(3)
        w_WB = w_R + self._gyro_bias + s.gyro_noise_sd_rad_per_s * rng.standard_normal(3)
        return a_B, w_WB, _turned_about_z(q_WR, s.yaw_drift_rad_per_s * t)


def _turned_about_z(q: np.ndarray, angle: float) -> np.ndarray:
    """The attitude q (xyzw) turned by an angle [rad] about the vertical."""
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    x, y, z, w = q
    return np.array([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z])

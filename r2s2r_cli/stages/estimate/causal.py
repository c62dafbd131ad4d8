"""What was known of the end caps at a frame, from it and those before: the forward pass of the smoother alone.

A smoothed pose knows later frames. Where motors start it leans towards what comes (measured: cables have moved by 7 mm
already, with noise of 10 mm), always the same way, and what is predicted from it is compared with frames that it has
used. A start for a prediction must not know them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.kalman import Disturbances, forward, update
from r2s2r_cli.stages.estimate.smooth import BURSTS, JUMP, JUMP_SD, MISSING, OUTLIER, fit_density

KICK_M_PER_S = 0.06
"""Change of a cap's velocity where a motor is switched, sd."""
SPEED_M_PER_S = 0.05
"""Speed of a cap before it is looked at, sd of a component: a few frames that are noisy tell no velocity."""


@dataclass(frozen=True)
class Known:
    """p_WE [m], v_WE [m/s] and their sd, (frame, cap, 3)."""

    p_WE: np.ndarray
    v_WE: np.ndarray
    sd_p: np.ndarray
    sd_v: np.ndarray


def known(
    t: np.ndarray, p_WE: np.ndarray, noise_sd: np.ndarray, quality: np.ndarray, changes: np.ndarray
) -> Known:  # fmt: skip
    """T (frame,) [s]; p_WE (frame, cap, 3) [m]; noise_sd, of that shape or (cap, 3) [m]; quality (frame, cap): codes of
    `smooth`; changes: gaps between frames in which a motor was switched."""
    n = len(t)
    unused = (quality == OUTLIER) | (quality == MISSING)
    y = np.where(unused[:, :, None], np.nan, p_WE).reshape(n, -1)
    var = np.broadcast_to(np.square(noise_sd), p_WE.shape).reshape(n, -1)
    kick = np.zeros(n - 1)
    kick[changes] = KICK_M_PER_S**2
    jump = np.repeat(np.where(quality == JUMP, JUMP_SD**2, 0.0), 3, axis=1)[1:]
    free = Disturbances(kick, jump)
    density = np.repeat(BURSTS * 10.0 ** fit_density(t, y, var, free), 3)
    run = forward(t, y, var, density[None], free)
    mean = run.mean + run.gain * run.innovation[..., None]
    cov = np.array([update(run.cov[k], run.gain[k], var[k]) for k in range(n)])
    # The filter starts from any speed at all; robots have moderate ones.
    share = SPEED_M_PER_S**2 / (SPEED_M_PER_S**2 + cov[..., 1, 1])
    p = mean[..., 0] - cov[..., 0, 1] / (SPEED_M_PER_S**2 + cov[..., 1, 1]) * mean[..., 1]
    var_p = cov[..., 0, 0] - cov[..., 0, 1] ** 2 / (SPEED_M_PER_S**2 + cov[..., 1, 1])
    shape = p_WE.shape
    return Known(
        p.reshape(shape), (share * mean[..., 1]).reshape(shape), np.sqrt(var_p).reshape(shape),
        np.sqrt(share * cov[..., 1, 1]).reshape(shape),
    )  # fmt: skip

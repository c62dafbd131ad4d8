"""End-cap tracks: smoothed positions and velocities, their covariance, and what the track itself contradicts.

Model, per cap and axis: the acceleration is white noise (position = integrated Wiener process), observed with the
noise measured from the run. One process noise a cap, at the maximum of the likelihood of its innovations: a resting
cap needs little, a swinging one much; shared by the three axes, so that the result does not depend on how the world
axes lie. White acceleration and not white jerk, because motors that are switched on and off change velocities
abruptly: `docs/concepts/estimate.md` has the held-out figures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.kalman import Disturbances, Filtered, Smoothed, backward, forward
from r2s2r_cli.stages.estimate.likelihood import log_likelihood

MIN_FRAMES = 5
"""Fewer frames leave no innovations to fit the process noise to (two go into the start)."""
JUMP_SD = 1.0
"""[m] A tracker that lost a cap may find it anywhere: wide compared with the robot, so the size of a jump is free."""
GRID = (-8.0, 2.0)
"""Decades searched for the spectral density. At the lower end 1 s changes a velocity by 0.1 mm/s: a straight line; at
the upper one by 10 m/s: no robot. A fault that is not marked yet may ask for more; the bound keeps it from hiding."""
COARSE, FINE = 0.5, 0.1
"""Decades to each side of the two finer grids."""
BURSTS = 2.0
"""What is used over what is likeliest. Robots accelerate in bursts, when motors switch and caps touch down; a density
that fits the run on average is too small there. On the planted samples (calibration seeds) 95 % ellipsoids hold 92 to
94 % of the positions and 86 to 91 % of the velocities at 1, 94 to 97 % and 92 to 96 % at 2."""
NEIGHBOURS = 5
"""A break is searched for among that many frames to each side at a time: one event shows in all of them."""
MAX_ROUNDS = 30
MAX_SHARE = 0.3
"""At most that share of a cap's frames is taken as broken; beyond, the model is wrong rather than the tracker."""

OBSERVED, MISSING, OUTLIER, JUMP = 0, 1, 2, 3
"""Codes of `quality`: used; not observed; observed and not used; used, and the track jumped just before it."""


@dataclass(frozen=True)
class Tracks:
    """Smoothed end caps of one run; the noise of the caps and axes counts as independent."""

    p_WE: np.ndarray
    """[m], shape (frame, cap, 3)."""
    v_WE: np.ndarray
    """[m/s], shape (frame, cap, 3)."""
    cov_p: np.ndarray
    """Covariance of p_WE [m^2], shape (frame, cap, 3, 3)."""
    cov_v: np.ndarray
    """Covariance of v_WE [m^2/s^2], shape (frame, cap, 3, 3)."""
    quality: np.ndarray
    """Codes OBSERVED, MISSING, OUTLIER, JUMP, uint8, shape (frame, cap)."""
    score: np.ndarray
    """Distance of each observation from what all other frames predict, in standard deviations, root mean square over
    the axes, shape (frame, cap); NaN where it was not observed or not used."""
    density: np.ndarray
    """Spectral density of the white acceleration [m^2/s^3] that was used, shape (cap,)."""
    innovation: np.ndarray
    """Innovations over their standard deviation at the highest likelihood, shape (frame, cap, 3); NaN where nothing was
    used or predicted."""


def smooth(
    t: np.ndarray,
    p_WE: np.ndarray,
    noise_sd: np.ndarray,
    *,
    changes: np.ndarray | None = None,
    kick_m_per_s: float = 0.02,
    gate: float = 1e-4,
) -> Tracks:
    """Smooth the caps of one run.

    t: stamps [s], shape (frame,), increasing. p_WE: [m], shape (frame, cap, 3), a cap that was not observed is NaN.
    noise_sd: [m], above 0, shape (cap, 3). changes: gaps (index k: between frames k and k + 1) in which a motor
    switched; the velocity may change by `kick_m_per_s` (standard deviation, per axis) there. gate: false-alarm
    probability of one test for an outlier or a jump.

    Every observation is tested against all others (leave-one-out), every gap for a jump of the position. The worst one
    of a neighbourhood is taken out, or let free to jump, and the run is smoothed again until none is beyond the gate.
    Raises NumericalError: too few frames, stamps that do not increase, a cap seen in fewer than five frames, or one
    that moves too wildly when all breaks are marked.
    """
    n, caps, _ = p_WE.shape
    seen = np.all(np.isfinite(p_WE), axis=2)
    _check(t, seen)
    limit = chi2_quantile(1.0 - gate)
    y = np.where(seen[:, :, None], p_WE, np.nan).reshape(n, caps * 3)
    var = np.broadcast_to(np.square(noise_sd).reshape(-1), y.shape)
    kick = np.zeros(n - 1)
    if changes is not None:
        kick[changes] = kick_m_per_s**2
    quality = np.where(seen, OBSERVED, MISSING).astype(np.uint8)
    found = np.zeros_like(quality)
    last: np.ndarray | None = None
    for _ in range(MAX_ROUNDS):
        quality = np.where(found > 0, found, quality).astype(np.uint8)
        used, free = _interventions(y, quality, kick)
        density = fit_density(t, used, var, free, last)
        state = backward(t, used, var, free, _filtered(t, used, var, free, density + np.log10(BURSTS)))
        found, last = _breaks(state, quality, limit), density
        if not np.any(found):
            break
    _check_explained(density)
    fit = _filtered(t, used, var, free, density)
    return _tracks(fit, state, quality, used, BURSTS * 10.0**density)


def switched(control: np.ndarray) -> np.ndarray:
    """Gaps between frames in which a motor is switched on, off or round. control: at each frame, (frame, actuated)."""
    return np.flatnonzero(np.any(np.diff(np.sign(np.nan_to_num(control)), axis=0) != 0, axis=1))


def whiteness(innovation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean square, lag-1 correlation and whether that is 0 within 2 standard deviations; each of shape (cap,).

    innovation: over its standard deviation, shape (frame, cap, 3), NaN where there is none.
    """
    z = np.nan_to_num(innovation)
    pairs = np.isfinite(innovation[1:]) & np.isfinite(innovation[:-1])
    square = np.nansum(innovation**2, axis=(0, 2))
    count = np.sum(np.isfinite(innovation), axis=(0, 2))
    lag1 = np.sum(z[1:] * z[:-1], axis=(0, 2)) / np.maximum(square, np.finfo(float).tiny)
    white = np.abs(lag1) < 2.0 / np.sqrt(np.maximum(np.sum(pairs, axis=(0, 2)), 1))
    return square / np.maximum(count, 1), lag1, white


def chi2_quantile(probability: float) -> float:
    """Quantile of the sum of three squared standard normals."""
    from scipy.special import chdtri

    return float(chdtri(3, 1.0 - probability))


def _check(t: np.ndarray, seen: np.ndarray) -> None:
    hint = "r2s2r inspect 10-record.h5   # shows which frames were kept and why the others were dropped"
    if not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
        raise NumericalError("the stamps of the kept frames do not increase", where="caps/t", hint=hint)
    if np.any(few := np.sum(seen, axis=0) < MIN_FRAMES):
        cap = int(np.argmax(few))
        raise NumericalError(
            f"end cap {cap} is seen in too few frames to be smoothed",
            where="caps/p_WE",
            expected=f"at least {MIN_FRAMES} kept frames",
            received=str(int(np.sum(seen[:, cap]))),
            hint=hint,
        )


def _interventions(y: np.ndarray, quality: np.ndarray, kick: np.ndarray) -> tuple[np.ndarray, Disturbances]:
    unused = np.repeat((quality == OUTLIER) | (quality == MISSING), 3, axis=1)
    jump = np.repeat(np.where(quality == JUMP, JUMP_SD**2, 0.0), 3, axis=1)[1:]
    return np.where(unused, np.nan, y), Disturbances(kick, jump)


def _filtered(t: np.ndarray, y: np.ndarray, var: np.ndarray, free: Disturbances, log_density: np.ndarray) -> Filtered:
    return forward(t, y, var, np.repeat(10.0**log_density, 3)[None], free)


def fit_density(
    t: np.ndarray, y: np.ndarray, var: np.ndarray, free: Disturbances, last: np.ndarray | None = None
) -> np.ndarray:
    """log10 of each cap's density of highest likelihood inside GRID: quarter decades, then two finer grids.

    last: that of the round before, near which it is searched first; a break that was taken out may have moved it by
    decades, then it is searched everywhere.
    """
    caps = y.shape[1] // 3

    def best(grid: np.ndarray) -> np.ndarray:
        loglik = log_likelihood(t, y, var, np.repeat(10.0**grid, 3, axis=1), free)
        pick = np.argmax(np.sum(loglik.reshape(len(grid), caps, 3), axis=2), axis=0)
        return grid[pick, np.arange(caps)]

    def near(centre: np.ndarray, half: float) -> np.ndarray:
        return best(np.clip(centre + np.linspace(-half, half, 11)[:, None], *GRID))

    found = None if last is None else near(last, COARSE)
    if found is None or np.any(np.abs(found - last) > 0.99 * COARSE):
        found = near(best(np.repeat(np.linspace(*GRID, 41)[:, None], caps, axis=1)), COARSE)
    return near(found, FINE)


def _check_explained(density: np.ndarray) -> None:
    if np.any(density >= GRID[1]):
        raise NumericalError(
            f"end cap {int(np.argmax(density))} moves too wildly to be smoothed: no process noise explains it",
            where="caps/p_WE",
            expected=f"a spectral density below 1e{GRID[1]:g}",
            received="the likelihood still rises there, with every outlier and jump that was found left out",
            hint="r2s2r inspect 10-record.h5   # check the unit of the stamps and positions",
        )


def _breaks(state: Smoothed, quality: np.ndarray, limit: float) -> np.ndarray:
    """New codes (0: none), at most one per cap in a neighbourhood: where a score is the worst one and beyond the gate.

    At the two ends an outlier and a jump cannot be told apart; the outlier is preferred, it claims less.
    """
    n, caps = quality.shape
    outlier = np.sum(state.outlier.reshape(n, caps, 3) ** 2, axis=2)
    jump = np.sum(state.jump.reshape(n, caps, 3) ** 2, axis=2)
    outlier[quality != OBSERVED] = 0.0
    jump[quality != OBSERVED] = 0.0
    jump[1] = jump[-1] = 0.0
    worst = np.maximum(outlier, jump)
    padded = np.pad(worst, ((NEIGHBOURS, NEIGHBOURS), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1, axis=0)
    peak = (worst >= windows.max(axis=2)) & (worst > limit)
    peak &= np.mean((quality == OUTLIER) | (quality == JUMP), axis=0) < MAX_SHARE
    return np.where(peak, np.where(jump > outlier * (1 + 1e-9), JUMP, OUTLIER), 0)


def _tracks(fit: Filtered, state: Smoothed, quality: np.ndarray, used: np.ndarray, density: np.ndarray) -> Tracks:
    n, caps = quality.shape
    eye = np.eye(3)
    var_p = state.cov[:, :, 0, 0].reshape(n, caps, 3)
    var_v = state.cov[:, :, 1, 1].reshape(n, caps, 3)
    seen = np.isfinite(used).reshape(n, caps, 3)
    predicted = seen & (np.cumsum(seen, axis=0) > 2)
    innovation = (fit.innovation / np.sqrt(fit.innovation_var)).reshape(n, caps, 3)
    score = np.sqrt(np.mean(state.outlier.reshape(n, caps, 3) ** 2, axis=2))
    return Tracks(
        p_WE=state.mean[:, :, 0].reshape(n, caps, 3),
        v_WE=state.mean[:, :, 1].reshape(n, caps, 3),
        cov_p=var_p[..., None] * eye,
        cov_v=var_v[..., None] * eye,
        quality=quality,
        score=np.where(seen[:, :, 0], score, np.nan),
        density=density,
        innovation=np.where(predicted, innovation, np.nan),
    )

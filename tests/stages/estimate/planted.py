"""A kinematic sample with a known truth: three rigid rods that move in starts and stops, as a crawling robot does.

Closed form, no physics. Constants of the estimate stage were chosen on CALIBRATION_SEEDS; the tests judge on
JUDGING_SEEDS only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CALIBRATION_SEEDS = range(10)
JUDGING_SEEDS = range(100, 110)
LENGTH = 0.325
RADIUS = 0.0175
N_INTERVALS = 10
INTERVAL_S = 1.5


@dataclass(frozen=True)
class Planted:
    """One run: what the tracker says and what is true. Shapes as in the estimate."""

    t: np.ndarray
    observed: np.ndarray
    p_WE: np.ndarray
    v_WE: np.ndarray
    noise_sd: np.ndarray
    contact: np.ndarray
    first: np.ndarray
    """First frame of every target interval."""


def planted(
    seed: int, *, noise_sd: tuple[float, float] = (0.001, 0.004), gap_s: float = 0.1, jitter_s: float = 0.03
) -> Planted:
    """A run of 15 s: every 1.5 s each rod starts towards a new place at constant speed and stops after 0.9 to 1.4 s.

    The even caps and both caps of the third rod stay on the ground; the odd caps of the others are put down in a third
    of the key shapes and raised by up to 120 mm in the rest. Speeds change within 60 ms.
    """
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(np.maximum(gap_s + jitter_s * rng.standard_normal(150), 0.03))])
    t = t[t < N_INTERVALS * INTERVAL_S]
    keys = _keys(rng)
    duration = rng.uniform(0.9, 1.4, size=(N_INTERVALS, 3))
    p = _caps(t, keys, duration)
    h = 1e-5
    v = (_caps(t + h, keys, duration) - _caps(t - h, keys, duration)) / (2 * h)
    sd = rng.uniform(*noise_sd, size=(6, 3))
    first = np.searchsorted(t, np.arange(N_INTERVALS) * INTERVAL_S)
    observed = p + sd * rng.standard_normal(p.shape)
    return Planted(t, observed, p, v, sd, p[:, :, 2] < RADIUS + 1e-4, first)


def _keys(rng: np.random.Generator) -> np.ndarray:
    """Per key shape and rod: x, y of the middle, azimuth, height of the even and of the odd cap."""
    keys = np.zeros((N_INTERVALS + 1, 3, 5))
    keys[:, :, 0] = np.cumsum(rng.normal(0.02, 0.03, size=(N_INTERVALS + 1, 3)), axis=0)
    keys[:, :, 1] = np.cumsum(rng.normal(0.0, 0.03, size=(N_INTERVALS + 1, 3)), axis=0)
    keys[:, :, 2] = np.array([0.0, 2.1, 4.2]) + np.cumsum(rng.normal(0.0, 0.15, size=(N_INTERVALS + 1, 3)), axis=0)
    keys[:, :, 3:] = RADIUS
    keys[:, :2, 4] += np.maximum(0.0, rng.uniform(-0.06, 0.12, size=(N_INTERVALS + 1, 2)))
    return keys


def _caps(t: np.ndarray, keys: np.ndarray, duration: np.ndarray) -> np.ndarray:
    k = np.clip((t // INTERVAL_S).astype(int), 0, N_INTERVALS - 1)
    since = t - k * INTERVAL_S
    share = _ramp(since[:, None], duration[k])[:, :, None]
    now = (1 - share) * keys[k] + share * keys[k + 1]
    rise = now[:, :, 4] - now[:, :, 3]
    flat = np.sqrt(LENGTH**2 - rise**2)
    axis = np.stack([flat * np.cos(now[:, :, 2]), flat * np.sin(now[:, :, 2]), rise], axis=-1)
    middle = np.stack([now[:, :, 0], now[:, :, 1], 0.5 * (now[:, :, 3] + now[:, :, 4])], axis=-1)
    return np.stack([middle - 0.5 * axis, middle + 0.5 * axis], axis=2).reshape(len(t), 6, 3)


def _ramp(since: np.ndarray, duration: np.ndarray, blend: float = 0.06) -> np.ndarray:
    """0 to 1 over `duration` at constant speed, with `blend` seconds of constant acceleration at both ends."""
    speed = 1.0 / (duration - blend)
    s = np.clip(since, 0.0, duration)
    start = 0.5 * speed / blend * np.minimum(s, blend) ** 2
    middle = speed * np.clip(s - blend, 0.0, duration - 2 * blend)
    left = np.clip(s - (duration - blend), 0.0, blend)
    return start + middle + speed * (left - 0.5 * left**2 / blend)

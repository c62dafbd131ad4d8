"""What the run itself says about noise: of the sightings, of the sensors, and of the motion."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.chain import Marginals
from r2s2r_cli.stages.estimate.motion.equations import unit_information
from r2s2r_cli.stages.estimate.motion.evidence import Evidence

WILD = 25.0
"""Squared distance over variance beyond which a sighting says nothing about the ordinary noise (3 parts: 2e-5)."""
FLOOR_DENSITY = 1e-5
"""[m^2/s^3] Least density: a cap whose speed changes by 3 mm/s in a second, at rest in all but name."""
PRIOR_GAPS = 1.0
"""Weight of the run's mean against the gap's own neighbourhood, in gaps."""
REACH = 2
"""Gaps to each side that share a burst."""
PRIOR_SIGHTINGS = 50.0
"""Weight of what the sightings themselves state about their noise, in sightings."""
_PARTS = 6
"""Of one gap of one cap: position and velocity, three axes."""


def sighting_scale(residual: np.ndarray, cov_seen: np.ndarray, axes: np.ndarray, cov_state: np.ndarray) -> np.ndarray:
    """Factor on the variances of the sightings across and along the line of sight, shape (2,).

    Of used sightings: residual (n, 3) [m]; cov_seen, cov_state: of sighting and smoothed state, (n, 3, 3); axes: unit
    vectors of the sighting's principal axes, rows ascending, (n, 3, 3). The residual against a state that the sighting
    itself took part in has the difference of both variances.
    """
    part = np.einsum("nij,nj->ni", axes, residual)
    seen = np.einsum("nij,njk,nik->ni", axes, cov_seen, axes)
    state = np.einsum("nij,njk,nik->ni", axes, cov_state, axes)
    usual = np.sum(part**2 / seen, axis=1) < WILD
    found = part[usual] ** 2 / seen[usual]
    expected = np.clip(1.0 - state[usual] / seen[usual], 0.02, 1.0)
    factor = [
        (np.sum(found[:, which]) + PRIOR_SIGHTINGS) / (np.sum(expected[:, which]) + PRIOR_SIGHTINGS)
        for which in (slice(0, 2), slice(2, 3))
    ]
    return np.clip(factor, 0.25, 4.0)


def sensor_variance(residual: np.ndarray, variance: np.ndarray, state: np.ndarray, usual: np.ndarray) -> float:
    """Factor on the variance of one sensor; residual, its variance and that of the predicted length, (frame,)."""
    found = np.sum((residual**2 / variance)[usual])
    expected = np.sum(np.clip(1.0 - state / variance, 0.02, 1.0)[usual])
    return float(np.clip((found + 5.0) / (expected + 5.0), 0.04, 25.0))


def gap_density(x: np.ndarray, marginal: Marginals, evidence: Evidence, body: Body) -> np.ndarray:
    """Expected square of the disturbance of each gap and cap as a density [m^2/s^3], (frame - 1, cap).

    The step of the EM algorithm for the process noise (Shumway and Stoffer 1982), for each gap by itself.
    """
    dt = np.diff(evidence.t)
    caps, half = body.caps, 3 * body.caps
    out = np.zeros((len(dt), 2, 2, half))
    rows = np.arange(half)
    index = [rows, half + rows]

    def pick(matrix: np.ndarray, i: int, j: int) -> np.ndarray:
        return np.asarray(matrix[:, index[i], index[j]])

    pair = np.stack([x[:, :half], x[:, half : body.moving]], axis=1)
    f = np.zeros((len(dt), 2, 2))
    f[:, 0, 0] = f[:, 1, 1] = 1.0
    f[:, 0, 1] = dt
    off = pair[1:] - np.einsum("kij,kjc->kic", f, pair[:-1])
    now = np.stack([np.stack([pick(marginal.cov, i, j) for j in range(2)], axis=1) for i in range(2)], axis=1)
    # cross[k] is the covariance of frames k (rows) and k + 1 (columns).
    cross = np.stack([np.stack([pick(marginal.cross, i, j) for j in range(2)], axis=1) for i in range(2)], axis=1)
    turned = np.einsum("kia,kajc->kijc", f, cross)
    out = (
        off[:, :, None] * off[:, None, :] + now[1:] - turned - np.swapaxes(turned, 1, 2)
        + np.einsum("kia,kabc,kjb->kijc", f, now[:-1], f)
    )  # fmt: skip
    unit = unit_information(dt)
    each = np.einsum("kij,kjic->kc", unit, out)
    return np.asarray(each.reshape(len(dt), caps, 3).sum(axis=2) / _PARTS)


def next_density(each: np.ndarray, kick: np.ndarray, dt: np.ndarray, believed: np.ndarray) -> np.ndarray:
    """Density of every gap and cap for the next round: its neighbourhood, drawn to the mean of the run.

    each: of `gap_density`; kick: (frame - 1,); believed: whether anything told of the cap's motion, (frame - 1, cap).
    Motion comes in bursts: at rest the density is small, where motors pull and caps touch down it is large.
    """
    own = np.maximum(each - (kick / dt)[:, None], FLOOR_DENSITY)
    weight = believed.astype(float)
    mean = np.sum(own * weight, axis=0) / np.maximum(np.sum(weight, axis=0), 1e-9)
    mean = np.where(np.sum(weight, axis=0) > 0, mean, np.mean(own))
    kernel = 1.0 - np.abs(np.arange(-REACH, REACH + 1)) / (REACH + 1.0)
    total = np.stack([np.convolve((own * weight)[:, c], kernel, mode="same") for c in range(own.shape[1])], axis=1)
    count = np.stack([np.convolve(weight[:, c], kernel, mode="same") for c in range(own.shape[1])], axis=1)
    return np.asarray(np.maximum((total + PRIOR_GAPS * mean) / (count + PRIOR_GAPS), FLOOR_DENSITY))

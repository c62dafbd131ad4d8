"""The end: what of the states and covariances is handed on, and how each frame is marked."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.contacts import contacts
from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import (
    BLIND,
    HIDDEN,
    LOST,
    NO_SENSORS,
    PARTLY_HIDDEN,
    REJECTED,
    SEEN,
    MotionSettings,
    SensorClock,
    TrackedRun,
)  # fmt: skip
from r2s2r_cli.stages.estimate.motion.equations import SIGHTING_FREEDOM
from r2s2r_cli.stages.estimate.motion.factors import heavy_tail
from r2s2r_cli.stages.estimate.motion.prepare import Prepared, principal
from r2s2r_cli.stages.estimate.motion.rounds import State, cap_covariances, distances, known, sighting_residual

USED = 0.3
"""A sighting whose weight fell below this share contradicts the rest: nearly 5 standard deviations off."""
LEVERAGE_LEAST = 0.25
"""Least share of a sighting's variance that its distance from the state is measured by: where the state follows a
single sighting that distance is next to nothing, and so is its variance."""
TOUCHES_M = 0.015
"""[m] A cap that is written down higher does not touch, however likely it is that it does."""
SHARED_ALONG = 0.1
"""Share of the error along the line of sight that all frames have in common (standard deviations): of depth cameras it
is mostly noise, but not all."""
SHARED_ACROSS = 0.3
"""The same across it: where rims lie in a pixel, and how a picture stores colour, are alike for all caps and frames."""
NEAR_S = 0.25
"""[s] A sensor that was not heard for that long before and after a frame is missing there."""


def tracked_run(
    state: State, prepared: Prepared, clock: SensorClock, body: Body, settings: MotionSettings
) -> TrackedRun:
    """At the run's own frames; the knots in its holes are left out."""
    x, cov, rows = state.x, known(state).cov, prepared.given
    p_cov = cap_covariances(cov, body)
    speed = 3 * body.caps
    v_cov = np.stack([cov[:, (b := body.p(c) + speed)[:, None], b] for c in range(body.caps)], axis=1)
    length, _, length_sd = distances(x, cov, body, body.cable)
    quality, score = _quality(state, prepared, body)
    variance = np.diagonal(cov, axis1=1, axis2=2)
    heard = _heard(state.evidence.t, state.evidence.sensor_weight)
    shown = p_cov + _everywhere(prepared)
    worst = np.sqrt(np.linalg.eigvalsh(shown)[..., -1])
    mode = (
        np.where(np.any(heard, axis=1), 0, NO_SENSORS)
        | np.where(np.any(quality != SEEN, axis=1), PARTLY_HIDDEN, 0)
        | np.where(np.all(quality != SEEN, axis=1), BLIND, 0)
        | np.where(np.any(worst > settings.lost_sd_m, axis=1), LOST, 0)
    ).astype(np.uint8)
    first = np.searchsorted(rows, np.arange(len(x) - 1), side="right") - 1
    return TrackedRun(
        t=prepared.t[rows], p_WE=body.positions(x)[rows], cov_p=shown[rows], v_WE=body.velocities(x)[rows],
        cov_v=v_cov[rows], length=length[rows], length_sd=length_sd[rows], sensor_bias=x[rows, body.bias],
        sensor_bias_sd=np.sqrt(variance[rows, body.bias]), sensor_noise_sd=state.noise,
        sensor_dead=~np.any(state.evidence.sensor_weight > 0, axis=0), clock=clock,
        ground=np.zeros(3), ground_sd=np.array([settings.ground_sd_m, *2 * [settings.ground_tilt_sd_rad]]),
        contact=(contacts(state.evidence.touching) & _near_floor(x, worst, body, settings))[rows],
        contact_probability=state.evidence.touching[rows],
        quality=quality[rows], mode=mode[rows], score=score[rows], noise_scale=np.sqrt(state.factor),
        acceleration=np.array([state.evidence.density[first == k].mean(axis=0) for k in range(len(rows) - 1)]),
        rounds=state.rounds, settled=state.solved is not None and state.solved.settled,
    )  # fmt: skip


def _everywhere(prepared: Prepared) -> np.ndarray:
    """What all sightings err alike, as covariances [m^2], (frame, cap, 3, 3): no state of the run knows of it."""
    values, axes = principal(prepared.cov)
    usual = np.median(values[prepared.sighted], axis=0)
    ray = axes[prepared.sighted][:, 2]
    along = np.linalg.eigh(ray.T @ ray)[1][:, 2]
    line = np.outer(along, along)
    across = SHARED_ACROSS**2 * 0.5 * (usual[0] + usual[1])
    return np.broadcast_to(SHARED_ALONG**2 * usual[2] * line + across * (np.eye(3) - line), prepared.cov.shape)


def _quality(state: State, prepared: Prepared, body: Body) -> tuple[np.ndarray, np.ndarray]:
    off, spread = sighting_residual(state.x, known(state).cov, state.evidence, body)
    information = state.evidence.information
    square = np.einsum("kci,kcij,kcj->kc", off, information, off)
    used = prepared.sighted & (heavy_tail(square, 3, SIGHTING_FREEDOM) > USED)
    quality = np.where(prepared.sighted, np.where(used, SEEN, REJECTED), HIDDEN).astype(np.uint8)
    score = np.full(square.shape, np.nan)
    rows = np.nonzero(prepared.sighted)
    seen = np.linalg.inv(information[rows])
    # A used sighting took part in the state, so that the difference has the difference of both variances.
    total = np.where(used[rows][:, None, None], seen - spread[rows], seen + spread[rows])
    values, axes = np.linalg.eigh(total)
    part = np.einsum("nai,na->ni", axes, off[rows])
    least = LEVERAGE_LEAST * np.einsum("nai,nab,nbi->ni", axes, seen, axes)
    score[rows] = np.sqrt(np.mean(part**2 / np.maximum(values, least), axis=1))
    return quality, score


def _near_floor(x: np.ndarray, worst: np.ndarray, body: Body, settings: MotionSettings) -> np.ndarray:
    """Caps that are neither lost nor written down high above the floor: only these are said to touch, (frame, cap)."""
    height = x[:, 2 + 3 * np.arange(body.caps)] - body.radius
    return (height < TOUCHES_M) & (worst <= settings.lost_sd_m)


def _heard(t: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Whether each sensor spoke within NEAR_S of each frame, (frame, sensor)."""
    out = np.zeros(weight.shape, dtype=bool)
    for s in range(weight.shape[1]):
        spoke = t[weight[:, s] > 0]
        if len(spoke):
            near = np.clip(np.searchsorted(spoke, t), 1, max(len(spoke) - 1, 1))
            before, after = spoke[near - 1], spoke[np.minimum(near, len(spoke) - 1)]
            out[:, s] = np.minimum(np.abs(t - before), np.abs(after - t)) <= NEAR_S
    return out

"""The normal equations of a run at given states: motion, sightings, rods, cables, floor, crossing rods."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.chain import Normal
from r2s2r_cli.stages.estimate.motion.crossing import add_crossings
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.evidence import Evidence
from r2s2r_cli.stages.estimate.motion.factors import Frames

SIGHTING_FREEDOM = 8.0
"""Of Student's t: few sightings are wild (another thing of the same colour)."""
START_SD = (3.0, 1.0)
"""Of position [m] and velocity [m/s] at the first frame: wide."""
SHARED_S = 1.0
"""[s] How long the errors that neighbouring sightings share stay alike."""
BELOW_SD_M = 1e-3
"""[m] Of how far any cap may be below the floor, whether it is known to touch or not."""
LIFTED_M, LIFTED_HIDDEN_M, LIFTED_BLIND_M = 0.03, 0.1, 1.0
"""[m] How high a cap may be that was taken to touch and does not: with the probability of that it widens the height
(the variance of the mixture of both). While it is hidden, times the root of the frames that share the mistake; while
all are, a roll that nobody saw makes all of them wrong together."""
SLIP_S = 0.3
"""[s] How long a cap keeps sliding: the slip speeds of neighbouring frames are one piece of evidence, not many."""


def equations(x: np.ndarray, evidence: Evidence, body: Body, settings: MotionSettings) -> tuple[float, Normal]:
    """Cost and normal equations at the states x, shape (frame, dim)."""
    frames = Frames(len(x), body.dim)
    _sightings(frames, x, evidence, body)
    _rods(frames, x, body, settings)
    _sensors(frames, x, evidence, body)
    _floor(frames, x, evidence, body, settings)
    add_crossings(frames, x, body)
    upper = _motion(frames, x, evidence, body)
    _start(frames, x, body, settings)
    return frames.cost, Normal(frames.matrix, upper, frames.gradient)


def apart(x: np.ndarray, body: Body, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of two caps and the unit vector from the first to the second, (frame,) and (frame, 3)."""
    bar = x[:, body.p(ends[1])] - x[:, body.p(ends[0])]
    length = np.maximum(np.linalg.norm(bar, axis=1), 1e-9)
    return length, bar / length[:, None]


def _sightings(frames: Frames, x: np.ndarray, evidence: Evidence, body: Body) -> None:
    for cap in range(body.caps):
        states = np.concatenate([body.p(cap), body.shared(cap)])
        slope = sighting_slope(evidence, body, cap)
        residual = (slope @ x[:, states, None])[:, :, 0] - evidence.seen[:, cap]
        frames.vector(states, slope, residual, evidence.information[:, cap], SIGHTING_FREEDOM, evidence.sighting_bend)


def sighting_slope(evidence: Evidence, body: Body, cap: int) -> np.ndarray:
    """Derivative of a sighting by the cap's position and its shared errors, (frame, 3, 3 or 5)."""
    eye = np.broadcast_to(np.eye(3), (evidence.frames, 3, 3))
    return np.concatenate([eye, evidence.across[:, cap]], axis=2) if body.sharing else eye


def _rods(frames: Frames, x: np.ndarray, body: Body, settings: MotionSettings) -> None:
    weight = np.full(len(x), settings.rod_sd_m**-2)
    for ends, length in zip(body.rod, body.rod_length, strict=True):
        now, u = apart(x, body, ends)
        frames.scalar(np.concatenate([body.p(ends[0]), body.p(ends[1])]), np.hstack([-u, u]), now - length, weight)


def _sensors(frames: Frames, x: np.ndarray, evidence: Evidence, body: Body) -> None:
    for s, ends in enumerate(body.sensor):
        weight = evidence.sensor_weight[:, s]
        if not np.any(weight):
            continue
        later = evidence.later[:, s, None]
        bar = x[:, body.p(ends[1])] - x[:, body.p(ends[0])]
        bar = bar + later * (x[:, body.v(ends[1])] - x[:, body.v(ends[0])])
        length = np.maximum(np.linalg.norm(bar, axis=1), 1e-9)
        u = bar / length[:, None]
        states = np.concatenate(
            [body.p(ends[0]), body.p(ends[1]), body.v(ends[0]), body.v(ends[1]), [body.bias.start + s]]
        )
        slope = np.hstack([-u, u, -later * u, later * u, np.ones((len(x), 1))])
        residual = length + x[:, body.bias.start + s] - evidence.shown[:, s]
        frames.scalar(states, slope, residual, weight, bend=evidence.sensor_bend)


def _floor(frames: Frames, x: np.ndarray, evidence: Evidence, body: Body, settings: MotionSettings) -> None:
    """Caps that carry weight lie on the floor and slip slowly; no cap is below it."""
    one = np.ones(len(x))
    slip = slip_weight(evidence.t, settings)
    blind = ~np.any(evidence.information[:, :, 2, 2] > 0, axis=1)
    for cap in range(body.caps):
        p = x[:, body.p(cap)]
        height = p[:, 2] - body.radius[cap]
        touching = evidence.touching[:, cap]
        below = (height < 0) / BELOW_SD_M**2
        hidden = np.where(blind, LIFTED_BLIND_M, LIFTED_HIDDEN_M)
        lifted = np.where(evidence.information[:, cap, 2, 2] > 0, LIFTED_M, hidden)
        stands = touching / (settings.contact_sd_m**2 + (1 - touching) * lifted**2)
        frames.scalar(body.p(cap)[2:], one[:, None], height, stands + below)
        if np.any(touching):
            for axis in range(2):
                v = x[:, body.v(cap)[axis]]
                frames.scalar(body.v(cap)[axis : axis + 1], one[:, None], v, touching**2 * slip, 4.0)


def slip_weight(t: np.ndarray, settings: MotionSettings) -> np.ndarray:
    """1 / variance of the horizontal speed of a touching cap in one frame, (frame,)."""
    share = np.minimum(np.gradient(t) / (2 * SLIP_S), 1.0)
    return np.asarray(share / settings.slip_sd_m_per_s**2)


def transition_information(evidence: Evidence) -> np.ndarray:
    """Inverse covariance of position and velocity over each gap, (frame - 1, cap, 2, 2)."""
    dt = np.diff(evidence.t)
    density = evidence.density + (evidence.kick / dt)[:, None]
    return np.asarray(unit_information(dt)[:, None] / density[:, :, None, None])


def unit_information(dt: np.ndarray) -> np.ndarray:
    """Inverse of `kalman.process`, (gap,) to (gap, 2, 2)."""
    rows = np.array([[12.0 * dt**-3, -6.0 * dt**-2], [-6.0 * dt**-2, 4.0 / dt]])
    return np.moveaxis(rows, 2, 0)


def _motion(frames: Frames, x: np.ndarray, evidence: Evidence, body: Body) -> np.ndarray:
    dt = np.diff(evidence.t)
    n, half = len(x), 3 * body.caps
    w = np.repeat(transition_information(evidence), 3, axis=1)
    f = np.zeros((n - 1, 1, 2, 2))
    f[:, 0, 0, 0] = f[:, 0, 1, 1] = 1.0
    f[:, 0, 0, 1] = dt
    fw = np.swapaxes(f, 2, 3) @ w
    fwf = fw @ f
    pair = np.stack([x[:, :half], x[:, half : body.moving]], axis=2)
    off = pair[1:] - np.einsum("kaij,kcj->kci", f, pair[:-1])
    push = np.einsum("kcij,kcj->kci", w, off)
    back = np.einsum("kaji,kcj->kci", f, push)
    frames.cost += 0.5 * float(np.sum(push * off))
    upper = np.zeros((n - 1, body.dim, body.dim))
    rows = np.stack([np.arange(half), half + np.arange(half)])
    for i in range(2):
        frames.gradient[1:, rows[i]] += push[:, :, i]
        frames.gradient[:-1, rows[i]] -= back[:, :, i]
        for j in range(2):
            frames.matrix[1:, rows[i], rows[j]] += w[:, :, i, j]
            frames.matrix[:-1, rows[i], rows[j]] += fwf[:, :, i, j]
            upper[:, rows[i], rows[j]] -= fw[:, :, i, j]
    _slow(frames, x, upper, np.arange(body.bias.start, body.bias.stop), np.ones_like(dt), evidence.sensor_drift)
    fade = np.exp(-dt / SHARED_S)
    _slow(frames, x, upper, np.arange(body.bias.stop, body.dim), fade, 1.0 - fade[:, None] ** 2)
    return upper


def _slow(
    frames: Frames, x: np.ndarray, upper: np.ndarray, states: np.ndarray, fade: np.ndarray, variance: np.ndarray
) -> None:
    """States that go on by themselves: times `fade` (gap,), plus noise of that `variance`, (gap, 1 or state)."""
    weight, keep = 1.0 / variance, fade[:, None]
    step = x[1:, states] - keep * x[:-1, states]
    frames.cost += 0.5 * float(np.sum(weight * step**2))
    frames.gradient[1:, states] += weight * step
    frames.gradient[:-1, states] -= keep * weight * step
    frames.matrix[1:, states, states] += weight
    frames.matrix[:-1, states, states] += keep**2 * weight
    upper[:, states, states] -= keep * weight


def _start(frames: Frames, x: np.ndarray, body: Body, settings: MotionSettings) -> None:
    sd = start_sd(body, settings)
    mean = np.zeros(body.dim)
    mean[: 3 * body.caps] = x[0, : 3 * body.caps]  # no place is likelier than another; the width only bounds it
    frames.cost += 0.5 * float(np.sum(((x[0] - mean) / sd) ** 2))
    frames.gradient[0] += (x[0] - mean) / sd**2
    frames.matrix[0, np.arange(body.dim), np.arange(body.dim)] += sd**-2


def start_sd(body: Body, settings: MotionSettings) -> np.ndarray:
    """Standard deviations of the state of the first frame, (dim,)."""
    sd = np.empty(body.dim)
    sd[: 3 * body.caps], sd[3 * body.caps : body.moving] = START_SD
    sd[body.bias] = settings.sensor_bias_sd_m
    sd[body.bias.stop :] = 1.0
    return sd

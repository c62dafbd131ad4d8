"""Alternate between the states and what they say about noise, sensors and contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.chain import Marginals, marginals
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.equations import sighting_slope
from r2s2r_cli.stages.estimate.motion.evidence import Evidence
from r2s2r_cli.stages.estimate.motion.noise import gap_density, next_density, sensor_variance, sighting_scale
from r2s2r_cli.stages.estimate.motion.prepare import Prepared, information, principal
from r2s2r_cli.stages.estimate.motion.sensors import LATE_S, offset_drift, sample_variance, sample_weights
from r2s2r_cli.stages.estimate.motion.shared import shared_errors
from r2s2r_cli.stages.estimate.motion.solve import Solved, solve
from r2s2r_cli.stages.estimate.motion.touching import touching_probability

STEPS = 10
"""Gauss-Newton steps of the last round, at most."""


@dataclass(frozen=True)
class State:
    """Where the alternation stands. factor: on variances of the sightings, (2,); noise: of a sample [m], (sensor,)."""

    x: np.ndarray
    evidence: Evidence
    factor: np.ndarray
    noise: np.ndarray
    solved: Solved | None = None
    marginal: Marginals | None = None
    rounds: int = 0


def settle(state: State, body: Body, settings: MotionSettings, *, steps: int = STEPS) -> State:
    """States and covariances for the present evidence."""
    solved = solve(state.x, state.evidence, body, settings, rounds=steps)
    return replace(
        state, x=solved.x, solved=solved, marginal=marginals(solved.done), rounds=state.rounds + solved.rounds
    )


def learn(state: State, prepared: Prepared, body: Body, settings: MotionSettings) -> State:
    """Noise of sightings, sensors and motion from the present states."""
    evidence, cov = state.evidence, known(state).cov
    rows = np.nonzero(prepared.sighted)
    residual, spread = sighting_residual(state.x, cov, evidence, body)
    values, axes = principal(prepared.cov[rows])
    scaled = values * np.array([state.factor[0], state.factor[0], state.factor[1]])
    seen = np.einsum("ni,nia,nib->nab", scaled, axes, axes)
    step = sighting_scale(residual[rows], seen, axes, spread[rows])
    factor = np.clip(state.factor * step, 0.05, 30.0)
    noise = state.noise.copy()
    rate = rates(state.x, body)
    slow = (LATE_S * rate) ** 2 <= sample_variance(evidence.samples, noise, 0.0 * rate)  # noise shows alone
    for s in range(len(noise)):
        used = (evidence.sensor_weight[:, s] > 0) & slow[:, s]
        if np.sum(used) < 10:
            continue
        residual, spread = sensor_residual(state.x, cov, evidence, body, s)
        variance = 1.0 / evidence.sensor_weight[used, s]
        square = residual[used] ** 2 / variance
        usual = square < 16.0 * max(float(np.median(square)) / 0.455, 0.1)
        noise[s] *= np.sqrt(sensor_variance(residual[used], variance, spread[used], usual))
    each = gap_density(state.x, known(state), evidence, body)
    heard = np.any(evidence.sensor_weight > 0, axis=1)[:, None]
    told = prepared.sighted | heard
    believed = told[1:] & told[:-1]
    density = next_density(each, evidence.kick, np.diff(evidence.t), believed)
    evidence = replace(
        evidence,
        information=information(prepared, factor),
        across=shared_errors(prepared, factor),
        density=density,
        sensor_weight=sample_weights(evidence.samples, noise, rate),
        sensor_drift=offset_drift(evidence.t, rate, settings.sensor_walk_m),
    )
    return replace(state, evidence=evidence, factor=factor, noise=noise)


def touch(state: State, prepared: Prepared, body: Body, *, hidden: bool) -> State:
    """Contacts from the present heights. hidden: also of caps while they are not sighted.

    Contacts that are put into the equations pull the heights they come from: where nothing else holds a height, a guess
    would prove itself. So contacts of hidden caps are told once, from heights that know none of them.
    """
    marginal = known(state)
    height, sd = heights(state.x, marginal.cov, body)
    touching = touching_probability(state.evidence.t, height, sd)
    if not hidden:
        touching = np.where(prepared.sighted, touching, 0.0)
    return replace(state, evidence=replace(state.evidence, touching=touching))


def known(state: State) -> Marginals:
    """Covariances of a state that was settled."""
    if state.marginal is None:
        raise ValueError("settle comes before anything that asks for covariances")
    return state.marginal


def rates(x: np.ndarray, body: Body) -> np.ndarray:
    """Of the sensors' lengths [m/s], (frame, sensor)."""
    found = np.empty((len(x), len(body.sensor)))
    for s, (a, b) in enumerate(body.sensor):
        bar = x[:, body.p(b)] - x[:, body.p(a)]
        u = bar / np.maximum(np.linalg.norm(bar, axis=1), 1e-9)[:, None]
        found[:, s] = np.sum(u * (x[:, body.v(b)] - x[:, body.v(a)]), axis=1)
    return found


def cap_covariances(cov: np.ndarray, body: Body) -> np.ndarray:
    """(frame, dim, dim) to those of the caps' positions, (frame, cap, 3, 3)."""
    return np.stack([cov[:, body.p(c)[:, None], body.p(c)] for c in range(body.caps)], axis=1)


def heights(x: np.ndarray, cov: np.ndarray, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Of the caps' lowest points above the floor, and their standard deviation [m], (frame, cap)."""
    states = 2 + 3 * np.arange(body.caps)
    return x[:, states] - body.radius, np.sqrt(np.maximum(cov[:, states, states], 1e-14))


def sighting_residual(x: np.ndarray, cov: np.ndarray, evidence: Evidence, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Sighted minus predicted, shared errors included [m], (frame, cap, 3), and the covariance of the prediction."""
    off = np.empty((len(x), body.caps, 3))
    spread = np.empty((len(x), body.caps, 3, 3))
    for cap in range(body.caps):
        states = np.concatenate([body.p(cap), body.shared(cap)])
        slope = sighting_slope(evidence, body, cap)
        off[:, cap] = evidence.seen[:, cap] - (slope @ x[:, states, None])[:, :, 0]
        spread[:, cap] = slope @ cov[:, states[:, None], states] @ np.swapaxes(slope, 1, 2)
    return off, spread


def distances(
    x: np.ndarray, cov: np.ndarray, body: Body, pairs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances of pairs of caps [m], their rates [m/s] and standard deviations [m], (frame, pair)."""
    shape = (len(x), len(pairs))
    length, rate, sd = np.empty(shape), np.empty(shape), np.empty(shape)
    for i, (a, b) in enumerate(pairs):
        bar = x[:, body.p(b)] - x[:, body.p(a)]
        length[:, i] = np.maximum(np.linalg.norm(bar, axis=1), 1e-9)
        u = bar / length[:, i : i + 1]
        rate[:, i] = np.sum(u * (x[:, body.v(b)] - x[:, body.v(a)]), axis=1)
        states, slope = np.concatenate([body.p(a), body.p(b)]), np.hstack([-u, u])
        sd[:, i] = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, cov[:, states[:, None], states], slope), 0.0))
    return length, rate, sd


def sensor_residual(
    x: np.ndarray, cov: np.ndarray, evidence: Evidence, body: Body, s: int
) -> tuple[np.ndarray, np.ndarray]:
    """Shown minus predicted by one sensor [m], and the variance of the prediction [m^2], (frame,)."""
    a, b = body.sensor[s]
    later = evidence.later[:, s, None]
    bar = x[:, body.p(b)] - x[:, body.p(a)] + later * (x[:, body.v(b)] - x[:, body.v(a)])
    length = np.maximum(np.linalg.norm(bar, axis=1), 1e-9)
    u = bar / length[:, None]
    bias = body.bias.start + s
    states = np.concatenate([body.p(a), body.p(b), [bias]])
    slope = np.hstack([-u, u, np.ones((len(x), 1))])
    variance = np.einsum("ki,kij,kj->k", slope, cov[:, states[:, None], states], slope)
    return evidence.shown[:, s] - length - x[:, bias], variance

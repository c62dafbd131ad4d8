"""A stretch of a run at once: states, covariances, sensor offsets, clock and contacts from stored sightings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, SensorClock, Sighted, TrackedRun
from r2s2r_cli.stages.estimate.motion.prepare import first_evidence, first_states, prepare
from r2s2r_cli.stages.estimate.motion.result import tracked_run
from r2s2r_cli.stages.estimate.motion.rounds import State, distances, known, learn, settle, touch
from r2s2r_cli.stages.estimate.motion.sensor_clock import find_clock
from r2s2r_cli.stages.estimate.motion.sensors import bin_readings, offset_drift, sample_weights
from schemas.robot import Robot

BURSTS = 2.0
"""What is used over what is likeliest (as in `stages/estimate/smooth.py`): robots accelerate in bursts."""
UNSEEN_BURSTS = 6.0
"""The same where a cap is hidden: how it moved there is only known on average, and averages have few bursts."""
BLIND_BURSTS = 60.0
"""The same where no cap is seen at all: then the robot may roll as one, which no cable and no rod tells."""
FEW = 2
"""Gauss-Newton steps between two looks at the noise: it need not settle before the noise does."""
SENSOR_BEND = 2.5
"""Sensor samples are wild at times (dropouts), so that their cost bends; but it never stops growing, because a first
guess of a hidden cap may be far off where all its sensors seem wild. They come in unbent, once, for the same reason."""
ALONE, TOGETHER = 2, 3
"""Rounds of states and noise: with sightings alone, and with everything."""


def smooth_window(
    sighted: Sighted,
    readings: Readings | None,
    robot: Robot,
    settings: MotionSettings,
    switches: np.ndarray | None,
    before: SensorClock | None,
) -> TrackedRun:
    """See `smooth_run`. before: clock of the stretch before, for one in which nothing moves.

    First the sightings and rods alone: they give the clock of the sensors, their offsets and the first contacts. Then
    everything together, the noise of each source and of the motion as the stretch shows it.
    """
    body = Body.of(robot, None if readings is None else readings.cable, sharing=True)
    prepared = prepare(sighted, body)
    state = State(
        x=first_states(prepared, body), evidence=first_evidence(prepared, body, settings, switches), factor=np.ones(2),
        noise=np.full(len(body.sensor), settings.sensor_noise_sd_m),
    )  # fmt: skip
    for _ in range(ALONE):
        state = learn(settle(state, body, settings, steps=FEW), prepared, body, settings)
    state = settle(state, body, settings, steps=FEW)
    state, clock = _with_sensors(state, readings, body, settings, before)
    state = touch(state, prepared, body, hidden=False)
    state = settle(state, body, settings)
    state = replace(state, evidence=replace(state.evidence, sighting_bend=None, sensor_bend=SENSOR_BEND))
    for left in reversed(range(TOGETHER)):
        state = learn(settle(state, body, settings, steps=FEW), prepared, body, settings)
        state = touch(state, prepared, body, hidden=left == 0)
    near = prepared.sighted[1:] & prepared.sighted[:-1]
    blind = ~np.any(near, axis=1, keepdims=True)
    density = np.where(near, BURSTS, np.where(blind, BLIND_BURSTS, UNSEEN_BURSTS)) * state.evidence.density
    state = settle(replace(state, evidence=replace(state.evidence, density=density)), body, settings)
    return tracked_run(state, prepared, clock, body, settings)


def _with_sensors(
    state: State, readings: Readings | None, body: Body, settings: MotionSettings, before: SensorClock | None
) -> tuple[State, SensorClock]:
    """Sensors at the frames they belong to, offsets from where the camera sees well."""
    if readings is None or not np.any(np.isfinite(readings.length)):
        return state, SensorClock(0.0, float("inf"), False)
    t = state.evidence.t
    length, rate, sd = distances(state.x, known(state).cov, body, body.sensor)
    clock = find_clock(t, length, rate, sd, readings, settings.clock_range_s)
    if not clock.known and before is not None:
        clock = before
    binned = bin_readings(t, readings, clock.delay_s)
    x = state.x.copy()
    for s in range(len(body.sensor)):
        clear = (binned.samples[:, s] > 0) & (sd[:, s] < 3 * settings.sensor_noise_sd_m)
        if np.any(clear):
            x[:, body.bias.start + s] = np.median((binned.shown - length - binned.later * rate)[clear, s])
    evidence = replace(
        state.evidence, shown=binned.shown, later=binned.later, samples=binned.samples,
        sensor_weight=sample_weights(binned.samples, state.noise, rate),
        sensor_drift=offset_drift(t, rate, settings.sensor_walk_m),
    )  # fmt: skip
    return replace(state, x=x, evidence=evidence), clock

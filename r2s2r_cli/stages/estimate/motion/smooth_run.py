"""The whole run: states, covariances, sensor offsets, clock and contacts from stored sightings, stretch by stretch."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, SensorClock, Sighted, TrackedRun
from r2s2r_cli.stages.estimate.motion.prepare import prepare
from r2s2r_cli.stages.estimate.motion.window import smooth_window
from schemas.robot import Robot

LONGEST = 1200
"""Frames of one stretch. The equations of a frame take 0.2 MB: longer runs are cut, so that memory stays the same."""
OVERLAP = 120
"""Frames that neighbouring stretches share; each gives one half. A smoother forgets within tens of frames."""
PER_FRAME = (
    "t", "p_WE", "cov_p", "v_WE", "cov_v", "length", "length_sd", "sensor_bias", "sensor_bias_sd", "contact",
    "contact_probability", "quality", "mode", "score",
)  # fmt: skip


def smooth_run(
    sighted: Sighted,
    readings: Readings | None,
    robot: Robot,
    settings: MotionSettings | None = None,
    *,
    switches: np.ndarray | None = None,
) -> TrackedRun:
    """Maximum of the posterior over all frames, and its covariance.

    switches: gaps between frames (index k: between k and k + 1) in which a motor was switched, shape (any,).
    Runs of more than LONGEST frames are smoothed in stretches that overlap; what belongs to the whole run (noise,
    clock) is then the median of the stretches.
    Raises InputError where some cap is never sighted or the stamps do not increase; NumericalError where the search
    fails.
    """
    settings = settings or MotionSettings()
    if len(sighted.t) <= LONGEST:
        return smooth_window(sighted, readings, robot, settings, switches, None)
    prepared = prepare(sighted, Body.of(robot))
    parts: list[TrackedRun] = []
    clock: SensorClock | None = None
    cuts = windows(prepared.sighted[prepared.given])
    for first, last in cuts:
        part = Sighted(sighted.t[first:last], sighted.p_WE[first:last], sighted.cov[first:last])
        own = None if switches is None else switches[(switches >= first) & (switches < last - 1)] - first
        heard = _near(readings, part.t, settings.clock_range_s)
        parts.append(smooth_window(part, heard, robot, settings, own, clock))
        clock = parts[-1].clock if parts[-1].clock.known else clock
    return _joined(parts, cuts)


def windows(seen: np.ndarray) -> list[tuple[int, int]]:
    """First frame and the one after the last of stretches that overlap; each shows every cap at least once.

    seen: (frame, cap) bool. A stretch that misses a cap is joined with the next, the last one with that before.
    """
    n, found, first = len(seen), [], 0
    while True:
        last = min(first + LONGEST, n)
        while last < n and not np.all(np.any(seen[first:last], axis=0)):
            last = min(last + LONGEST, n)
        found.append((first, last))
        if last == n:
            break
        first = last - OVERLAP
    while len(found) > 1 and not np.all(np.any(seen[found[-1][0] :], axis=0)):
        found[-2:] = [(found[-2][0], n)]
    return found


def _near(readings: Readings | None, t: np.ndarray, range_s: float) -> Readings | None:
    if readings is None:
        return None
    rows = (readings.t >= t[0] - range_s) & (readings.t <= t[-1] + range_s)
    return Readings(readings.t[rows], readings.length[rows], readings.cable)


def _joined(parts: list[TrackedRun], cuts: list[tuple[int, int]]) -> TrackedRun:
    """One half of each overlap from each side."""
    edges = [0, *((a[1] + b[0]) // 2 for a, b in pairwise(cuts)), cuts[-1][1]]
    rows = [slice(a - cut[0], b - cut[0]) for (a, b), cut in zip(pairwise(edges), cuts, strict=True)]
    frames = {
        name: np.concatenate([getattr(part, name)[row] for part, row in zip(parts, rows, strict=True)])
        for name in PER_FRAME
    }
    gaps = [part.acceleration[row.start : row.stop] for part, row in zip(parts, rows, strict=True)]
    clocks = [part.clock for part in parts if part.clock.known]
    middle = sorted(clocks, key=lambda clock: clock.delay_s)[len(clocks) // 2] if clocks else parts[0].clock
    return replace(
        parts[0],
        **frames,
        acceleration=np.concatenate(gaps),
        clock=middle,
        sensor_noise_sd=np.median([part.sensor_noise_sd for part in parts], axis=0),
        sensor_dead=np.all([part.sensor_dead for part in parts], axis=0),
        noise_scale=np.median([part.noise_scale for part in parts], axis=0),
        rounds=sum(part.rounds for part in parts),
        settled=all(part.settled for part in parts),
    )

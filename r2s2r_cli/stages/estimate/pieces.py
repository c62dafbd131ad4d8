"""Long runs are smoothed piece by piece, so that memory does not grow with them.

The smoother holds matrices of all frames at once, a third of a megabyte a frame. Pieces overlap, and what lies in the
middle of an overlap knows 5 s of both sides: what is farther away says nothing more about a cap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, SensorClock, Sighted, TrackedRun
from r2s2r_cli.stages.estimate.motion.smooth_run import smooth_run
from schemas.robot import Robot

PIECE, OVERLAP = 900, 150
"""Frames: half a minute of 30 Hz, and 5 s more to each side."""
_SPARE_S = 1.0
"""Readings this long before and after a piece belong to it: clocks differ by less."""
_FRAMES = ("t", "p_WE", "cov_p", "v_WE", "cov_v", "length", "length_sd", "sensor_bias", "sensor_bias_sd", "contact",
           "contact_probability", "quality", "mode", "score")  # fmt: skip
"""Fields of a tracked run with one row a frame."""

Smooth = Callable[..., TrackedRun]


def smooth_pieces(
    sighted: Sighted, readings: Readings | None, robot: Robot, settings: MotionSettings, *, switches: np.ndarray,
    show: Callable[[int, int], None] = lambda done, total: None, piece: int = PIECE, overlap: int = OVERLAP,
    smooth: Smooth = smooth_run,
) -> TrackedRun:  # fmt: skip
    """As `smooth_run`, with the memory of one piece and two overlaps [frames]. show: pieces done and in all.

    Numbers of a whole run (noise of sightings and sensors, clock, floor) are those of the pieces, averaged; each piece
    uses its own. Raises as `smooth_run` does.
    """
    n = len(sighted.t)
    if n <= piece + 2 * overlap:
        show(0, 1)
        whole = smooth(sighted, readings, robot, settings, switches=switches)
        show(1, 1)
        return whole
    ends = np.linspace(0, n, -(-n // piece) + 1).round().astype(int)
    found: list[TrackedRun] = []
    for k, (first, last) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
        show(k, len(ends) - 1)
        a, b = _wide(sighted, first, last, overlap)
        inside = switches[(switches >= a) & (switches < b - 1)] - a
        cut = Sighted(sighted.t[a:b], sighted.p_WE[a:b], sighted.cov[a:b])
        found.append(_kept(smooth(cut, _heard(readings, cut.t), robot, settings, switches=inside),
                           first - a, last - a))  # fmt: skip
    show(len(found), len(found))
    return _joined(found)


def _wide(sighted: Sighted, first: int, last: int, overlap: int) -> tuple[int, int]:
    """A piece with its overlaps, and more until every cap is sighted in it."""
    n, reach = len(sighted.t), overlap
    while True:
        a, b = max(first - reach, 0), min(last + reach, n)
        if (a, b) == (0, n) or np.isfinite(sighted.p_WE[a:b, :, 0]).any(axis=0).all():
            return a, b
        reach *= 2


def _heard(readings: Readings | None, t: np.ndarray) -> Readings | None:
    if readings is None:
        return None
    near = (readings.t >= t[0] - _SPARE_S) & (readings.t <= t[-1] + _SPARE_S)
    return Readings(readings.t[near], readings.length[near], readings.cable)


def _kept(run: TrackedRun, first: int, last: int) -> TrackedRun:
    """Frames first .. last of a piece; copies, so that the rest is let go."""
    frames = {name: getattr(run, name)[first:last].copy() for name in _FRAMES}
    return replace(run, **frames, acceleration=run.acceleration[first:last].copy())


def _joined(runs: Sequence[TrackedRun]) -> TrackedRun:
    weight = np.array([len(run.t) for run in runs], dtype=float)
    weight /= weight.sum()

    def mean(name: str) -> np.ndarray:
        return np.asarray(np.einsum("k,k...->...", weight, np.array([getattr(run, name) for run in runs])))

    return TrackedRun(
        **{name: np.concatenate([getattr(run, name) for run in runs]) for name in _FRAMES},
        acceleration=np.concatenate([run.acceleration for run in runs]), sensor_noise_sd=mean("sensor_noise_sd"),
        sensor_dead=np.all([run.sensor_dead for run in runs], axis=0), clock=_clock([run.clock for run in runs]),
        ground=mean("ground"), ground_sd=mean("ground_sd"), noise_scale=mean("noise_scale"),
        rounds=sum(run.rounds for run in runs), settled=all(run.settled for run in runs),
    )  # fmt: skip


def _clock(clocks: Sequence[SensorClock]) -> SensorClock:
    """Mean of those that are known, by their certainty."""
    known = [clock for clock in clocks if clock.known]
    if not known:
        return clocks[0]
    information = np.array([1.0 / clock.sd_s**2 for clock in known])
    delay = float(np.sum(information * [clock.delay_s for clock in known]) / information.sum())
    return SensorClock(delay, float(1.0 / np.sqrt(information.sum())), True)

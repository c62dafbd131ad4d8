"""Simulated minus real, of one run: at the end, along the way, segment by segment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.repeats import gait_ends
from r2s2r_cli.stages.compare.walk import Walk


@dataclass(frozen=True)
class RunErrors:
    """What one simulator gets wrong of one run, both laid on each other where they begin.

    com_end: distance of the centres of mass over the ground at the end [m]; heading_end: absolute difference of how
    far both turned [rad], None where one has no heading; path: root mean square distance of the centres of mass over
    the ground [m]; cap: root mean square 3-D distance of the caps [m]; both at equal shares of each target interval.
    By interval (interval,): segment_end: RMS cap distance at its end [m]; gait: the same with both laid on each other
    at its start, so that only what went wrong within it counts [m]; duration_real, duration_sim [s].
    """

    com_end: float
    heading_end: float | None
    path: float
    cap: float
    segment_end: np.ndarray
    gait: np.ndarray
    duration_real: np.ndarray
    duration_sim: np.ndarray


def run_errors(real: Walk, simulated: Walk) -> RunErrors:
    """Of a simulated run and the real one, with the same target intervals. Raises ValueError where they differ."""
    if len(real.intervals) != len(simulated.intervals):
        raise ValueError(f"{len(real.intervals)} intervals against {len(simulated.intervals)}")
    laid = simulated.laid_on(real)
    away = laid.at_phase - real.at_phase
    com = np.einsum("c,ipcx->ipx", real.share, away)[..., :2]
    rms = np.sqrt(np.mean(np.sum(away**2, axis=-1), axis=-1))
    return RunErrors(
        com_end=float(np.linalg.norm(com[-1, -1])),
        heading_end=heading_difference(real, laid),
        path=float(np.sqrt(np.mean(np.sum(com**2, axis=-1)))),
        cap=float(np.sqrt(np.mean(rms**2))),
        segment_end=rms[:, -1],
        gait=_within(real, simulated),
        duration_real=real.durations,
        duration_sim=laid.durations,
    )


def heading_difference(one: Walk, other: Walk) -> float | None:
    """Absolute difference of how far both turned from the first frame to the last [rad]; None without headings."""
    if one.heading is None or other.heading is None:
        return None
    return float(abs((other.heading[-1] - other.heading[0]) - (one.heading[-1] - one.heading[0])))


def _within(real: Walk, simulated: Walk) -> np.ndarray:
    """RMS cap distance at the end of each interval, both laid on each other at its first frame, (interval,) [m]."""
    away = gait_ends(simulated, real) - real.at_phase[:, -1]
    return np.asarray(np.sqrt(np.mean(np.sum(away**2, axis=-1), axis=-1)))

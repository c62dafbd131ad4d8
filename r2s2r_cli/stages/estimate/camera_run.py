"""One run of camera images through the estimate: ground, pass over the pictures, smoothing; states out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.camera_input import Pictures, kept_frames, sensor_readings
from r2s2r_cli.stages.estimate.exchanged import check_names
from r2s2r_cli.stages.estimate.ground import Ground
from r2s2r_cli.stages.estimate.lengths import sensor_lengths
from r2s2r_cli.stages.estimate.motion.data import (
    LOST,
    NO_IMAGE,
    REJECTED,
    SEEN,
    MotionSettings,
    Readings,
    Sighted,
    TrackedRun,
)
from r2s2r_cli.stages.estimate.motion.smooth_run import smooth_run
from r2s2r_cli.stages.estimate.rigid import make_rigid
from r2s2r_cli.stages.estimate.run import RunState, intervals_of, switches
from r2s2r_cli.stages.estimate.smooth import MISSING, OBSERVED, OUTLIER, Tracks
from r2s2r_cli.stages.estimate.sweep import Sweep, Swept
from r2s2r_cli.stages.estimate.vision.frames import FrameSource
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.sight import Sighter
from r2s2r_cli.stages.estimate.vision.sightings import NO_PICTURE
from r2s2r_cli.stages.estimate.vision.survey import survey
from r2s2r_cli.stages.segments import Intervals, Segments
from schemas.estimate import EstimateSettings
from schemas.robot import Robot

LEFT_S = 1.5
"""Without a cap in view for longer than this up to its end, a run ends where the robot was last seen."""
LEAST_FRAMES = 10
"""A robot that is seen in fewer frames than this is not tracked to where it left, but refused further on."""
Table = TypeVar("Table", Intervals, Segments)
Show = Callable[[str, int, int, str], None]
"""Progress: part of the work, items done and in all, a word beside them (`Console.parts`)."""


@dataclass(frozen=True)
class CameraFacts:
    """What only a run of camera images has. Positions in W, ground at z = 0.

    X_WC: pose of the camera (4, 4). survey: what the pictures were found to be. swept, tracked: sightings and states,
    before the floor under the caps was put at z = 0. readings: of the cable sensors. residual: of `residuals`,
    (frame, cap, 3), NaN where there is none.
    """

    X_WC: np.ndarray
    lens: Intrinsics
    depth_scale: float
    survey: Survey
    swept: Swept
    tracked: TrackedRun
    readings: Readings | None
    residual: np.ndarray
    left_s: float | None = None
    """Time at which the robot left the picture for good [s]; the states end there. None: it stayed."""


def camera_run(
    run: str, streams: dict[str, Group], robot: Robot, settings: EstimateSettings, pictures: Pictures,
    show: Show = lambda part, done, total, word: None,
) -> RunState:  # fmt: skip
    """See `estimate`. pictures: the encoded images of a run. show: called after every frame.

    Raises InputError where the pictures cannot be tracked, NumericalError where no motion explains them.
    """
    rows, source = kept_frames(run, streams, pictures)
    try:
        return tracked_run(run, streams, source, robot, settings, rows=rows, show=show)
    except InputError as error:
        if f"run {run}" in error.what:
            raise
        raise InputError(
            f"run {run}: {error.what}", where=error.where or f"runs/{run}/camera", expected=error.expected,
            received=error.received, hint=error.hint,
        ) from error  # fmt: skip


def tracked_run(
    run: str, streams: dict[str, Group], source: FrameSource, robot: Robot, settings: EstimateSettings, *,
    rows: np.ndarray | None = None, show: Show = lambda part, done, total, word: None,
) -> RunState:  # fmt: skip
    """The same from frames that are there. rows: of the recording that they are, default all."""
    n, part, done = len(source), f"{run}: pictures", 0

    def advance(more: int) -> None:
        nonlocal done
        done += more
        show(part, done, n, "")

    known = survey(source, robot)
    motion = MotionSettings(kick_m_per_s=settings.switch_kick_m_per_s)
    if known.height_sd > motion.ground_sd_m:
        motion = replace(motion, ground_sd_m=known.height_sd)
    readings = sensor_readings(streams, robot)
    sighter = Sighter(robot, source.lens, source.depth_scale, known)
    swept = Sweep(run, source, sighter, known.X_WC, readings, robot, motion, advance).run()
    seen = swept.in_view
    if source.t[-1] - source.t[max(seen - 1, 0)] > LEFT_S and seen >= LEAST_FRAMES:
        # It walked out of the picture. What would be guessed from there on spoils what was seen before.
        n, swept = seen, swept.until(seen)
        if readings is not None:
            heard = readings.t <= source.t[n - 1]
            readings = Readings(readings.t[heard], readings.length[heard], readings.cable)
    names, doubt = check_names(swept.sighted, readings, robot, where=f"runs/{run}/camera")
    if names is not None:
        swept = swept.renamed(names)
    t = source.t[:n]
    show(f"{run}: smoothing", 0, 1, "")
    tracked = smooth_run(swept.sighted, readings, robot, motion, switches=switches(streams, t))
    show(f"{run}: smoothing", 1, 1, "")
    blank = np.all(swept.code == NO_PICTURE, axis=1)
    tracked = replace(tracked, mode=np.where(blank, tracked.mode | NO_IMAGE, tracked.mode).astype(np.uint8))
    if doubt is not None:
        known = replace(known, warnings=(*known.warnings, doubt))
    return _state(run, streams, source, t, robot, settings, known, swept, tracked, readings,
                  np.arange(n) if rows is None else rows[:n])  # fmt: skip


def _state(
    run: str, streams: dict[str, Group], source: FrameSource, t: np.ndarray, robot: Robot, settings: EstimateSettings,
    known: Survey, swept: Swept, tracked: TrackedRun, readings: Readings | None, rows: np.ndarray,
) -> RunState:  # fmt: skip
    shift = -float(tracked.ground[0])
    X_WC = known.X_WC.copy()
    X_WC[2, 3] += shift
    length = np.array([rod.length_m for rod in robot.rods])
    rods = make_rigid(
        tracked.p_WE, tracked.cov_p, tracked.v_WE, tracked.cov_v, length, np.zeros(len(length), dtype=bool)
    )
    observed = swept.sighted.p_WE
    residual = residuals(swept.sighted, tracked)
    quality = np.select([tracked.quality == SEEN, tracked.quality == REJECTED], [OBSERVED, OUTLIER], MISSING)
    variance = np.where(np.isfinite(observed), np.diagonal(swept.sighted.cov, axis1=2, axis2=3), np.nan)
    intervals, parts = intervals_of(streams, t)
    left = len(t) < len(source.t)
    lost = (tracked.mode & LOST) > 0
    lost[-1] |= left  # what it was doing then has no end
    seen_late = t + (tracked.clock.delay_s if tracked.clock.known else 0.0)
    return RunState(
        run=run, streams=streams, robot=robot, kept=rows, t=t, observed=observed,
        noise=_typical(np.sqrt(variance)) * float(np.exp(np.mean(np.log(tracked.noise_scale)))),
        held=np.zeros((robot.n_caps, 3), dtype=bool),
        tracks=Tracks(
            p_WE=tracked.p_WE, v_WE=tracked.v_WE, cov_p=tracked.cov_p, cov_v=tracked.cov_v,
            quality=quality.astype(np.uint8), score=tracked.score, density=np.mean(tracked.acceleration, axis=0),
            innovation=residual,
        ),
        rods=rods, rigid=np.zeros(len(length), dtype=bool),
        ground=Ground(shift=shift, shift_sd=float(tracked.ground_sd[0]), slope=tracked.ground[1:],
                      slope_sd=tracked.ground_sd[1:]),
        p_WE=rods.p_WE + np.array([0.0, 0.0, shift]), height_error=None, probability=tracked.contact_probability,
        contact=tracked.contact,
        intervals=None if intervals is None else _seen(intervals, lost),
        segments=None if parts is None else _seen(parts, lost),
        sensors=None if readings is None else sensor_lengths(seen_late, streams["sensors"], robot,
                                                             settings.sensor_gap_s),
        camera=CameraFacts(
            X_WC=X_WC, lens=source.lens, depth_scale=source.depth_scale, survey=known, swept=swept, tracked=tracked,
            readings=readings, residual=residual, left_s=float(t[-1]) if left else None,
        ),
    )  # fmt: skip


def _seen(table: Table, lost: np.ndarray) -> Table:
    """Intervals or segments, complete only where the robot was not lost at the first frame or at the key frame."""
    return replace(table, complete=table.complete & ~lost[table.first] & ~lost[table.last])


def residuals(sighted: Sighted, tracked: TrackedRun) -> np.ndarray:
    """Sightings that were used minus smoothed caps, over the standard deviations that the sightings themselves state.

    Along each sighting's principal axes, the best known first, shape (frame, cap, 3); NaN where none was used. Errors
    that neighbouring frames share are in it, which is why neighbours are alike; `score` is without them.
    """
    used = np.isfinite(sighted.p_WE[..., 0]) & (tracked.quality == SEEN)
    found = np.full(sighted.p_WE.shape, np.nan)
    value, vector = np.linalg.eigh(sighted.cov[used])
    off = np.einsum("kji,kj->ki", vector, (sighted.p_WE - tracked.p_WE)[used])
    found[used] = off / np.sqrt(value)
    return found


def _typical(sd: np.ndarray) -> np.ndarray:
    """Median over frames, shape (cap, 3); caps that were never seen get that of the others."""
    seen = np.isfinite(sd)
    overall = np.median(sd[seen]) if seen.any() else np.nan
    return np.array([[np.median(sd[seen[:, cap, i], cap, i]) if seen[:, cap, i].any() else overall for i in range(3)]
                     for cap in range(sd.shape[1])])  # fmt: skip

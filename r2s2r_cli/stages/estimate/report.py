"""What `estimate` reports about a run."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.camera_report import camera_figures, camera_warnings
from r2s2r_cli.stages.estimate.groups import innovations
from r2s2r_cli.stages.estimate.run import RunState
from r2s2r_cli.stages.estimate.smooth import JUMP, OUTLIER
from r2s2r_cli.stages.frames import fit_rod_length, ground_offset
from schemas.results_estimate import BrokenFrames, CapFigures, EstimateRun, GroundFigures, RodFigures

BROKEN_SHARE = 0.05
"""More outliers and jumps than this share of a cap's frames are worth a warning."""
HUNG_M = 0.005
"""A cap that is seen this far below the ground contradicts the ground plane."""
STEEP = 0.01
"""Slope of the ground beyond which it is worth a warning, if it is significant as well (about 0.6 degrees)."""


def run_report(state: RunState) -> EstimateRun:
    """Figures of one run."""
    caps = _caps(state)
    return EstimateRun(
        run=state.run,
        frames=len(state.t),
        rows=_rows(state),
        duration_s=float(state.t[-1] - state.t[0]),
        intervals=len(state.intervals) if state.intervals else 0,
        segments=len(state.segments) if state.segments else 0,
        source_rigid=bool(np.all(state.rigid)),
        caps=caps,
        rods=_rods(state),
        ground=_ground(state),
        broken=_broken(state),
        sensors=0 if state.sensors is None else len(state.sensors.cable),
        camera=None if state.camera is None else camera_figures(state, state.camera),
        warnings=(*_warnings(state, caps), *(() if state.camera is None else camera_warnings(state, state.camera))),
    )


def _rows(state: RunState) -> int:
    source = "caps" if state.camera is None else "camera"
    return len(state.streams[source]["t"]) if source in state.streams else len(state.t)


def _caps(state: RunState) -> tuple[CapFigures, ...]:
    variance, lag1, white = innovations(state)
    speed = np.linalg.norm(state.rods.v_WE, axis=-1)
    sd = np.sqrt(np.trace(state.rods.cov_p, axis1=2, axis2=3) / 3)
    return tuple(
        CapFigures(
            cap=cap,
            noise_sd_m=tuple(state.noise[cap].tolist()),
            held=tuple(state.held[cap].tolist()),
            sd_median_m=float(np.median(sd[:, cap])),
            outliers=int(np.sum(state.tracks.quality[:, cap] == OUTLIER)),
            jumps=int(np.sum(state.tracks.quality[:, cap] == JUMP)),
            contact_share=float(np.mean(state.contact[:, cap])),
            height_min_m=float(np.min(state.p_WE[:, cap, 2])),
            speed_median_m_per_s=float(np.median(speed[:, cap])),
            speed_max_m_per_s=float(np.max(speed[:, cap])),
            innovation_variance=float(variance[cap]),
            innovation_lag1=float(lag1[cap]),
            white=bool(white[cap]),
        )
        for cap in range(state.robot.n_caps)
    )


def _rods(state: RunState) -> tuple[RodFigures, ...]:
    length, sd = _observed_lengths(state.observed)
    moved = np.max(state.rods.correction, axis=0).reshape(-1, 2).max(axis=1)
    return tuple(
        RodFigures(
            rod=i,
            length_m=float(length[i]),
            length_sd_m=float(sd[i]),
            length_robot_m=rod.length_m,
            correction_max_m=float(moved[i]),
        )
        for i, rod in enumerate(state.robot.rods)
    )


def _observed_lengths(p_WE: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the rods, with NaN where a cap was not seen; a rod that never was has NaN."""
    found = []
    for even, odd in zip(range(0, p_WE.shape[1], 2), range(1, p_WE.shape[1], 2), strict=True):
        both = p_WE[:, [even, odd]]
        seen = both[np.isfinite(both).all(axis=(1, 2))]
        found.append([part[0] for part in fit_rod_length(seen)] if len(seen) else [np.nan, np.nan])
    length, sd = np.array(found).T
    return length, sd


def _ground(state: RunState) -> GroundFigures:
    ground = state.ground
    touching = np.sum(state.contact, axis=1)
    radius = np.repeat([rod.cap_radius_m for rod in state.robot.rods], 2)
    return GroundFigures(
        shift_m=ground.shift,
        shift_sd_m=ground.shift_sd,
        offset_recording_m=ground_offset(state.observed if state.camera is None else state.tracks.p_WE, radius),
        height_error_m=state.height_error,
        slope=None if ground.slope is None else (float(ground.slope[0]), float(ground.slope[1])),
        slope_sd=None if ground.slope_sd is None else (float(ground.slope_sd[0]), float(ground.slope_sd[1])),
        contacts_mean=float(np.mean(touching)),
        below_three_share=float(np.mean(touching < 3)),
    )


def _broken(state: RunState) -> tuple[BrokenFrames, ...]:
    """Frames and caps that are not smoothed over, by target interval."""
    bad = (state.tracks.quality == OUTLIER) | (state.tracks.quality == JUMP)
    frames = np.flatnonzero(np.any(bad, axis=1))
    interval = np.full(len(state.t), 0)
    if state.intervals is not None:
        for i, (first, last) in enumerate(zip(state.intervals.first, state.intervals.last, strict=True)):
            interval[first : last + 1] = i + 1
    return tuple(
        BrokenFrames(
            interval=int(i) or None,
            t_s=tuple(state.t[frames[interval[frames] == i]].tolist()),
            caps=tuple(np.flatnonzero(np.any(bad[interval == i], axis=0)).tolist()),
        )
        for i in np.unique(interval[frames])
    )


def _warnings(state: RunState, caps: tuple[CapFigures, ...]) -> tuple[str, ...]:
    found = []
    n = len(state.t)
    for cap in caps:
        if cap.outliers + cap.jumps > BROKEN_SHARE * n:
            found.append(
                f"end cap {cap.cap}: {cap.outliers} outlier{'s' * (cap.outliers != 1)} and "
                f"{cap.jumps} jump{'s' * (cap.jumps != 1)} in {n} frames; "
                "frames/quality marks them, the velocity beside a jump is weakly known"
            )
        if any(cap.held):
            axes = ", ".join(axis for axis, held in zip("xyz", cap.held, strict=True) if held)
            found.append(
                f"end cap {cap.cap}: the source holds {axes} still; the median noise of the run stands in for it"
            )
        radius = state.robot.rods[cap.cap // 2].cap_radius_m
        if cap.height_min_m < radius - HUNG_M:
            found.append(
                f"end cap {cap.cap} is seen {1e3 * (radius - cap.height_min_m):.1f} mm below the ground at its lowest"
            )
    if state.height_error is None and state.camera is None:
        found.append("the robot is not seen to stand on three caps: contacts trust the heights as they are")
    ground = state.ground
    if ground.slope is not None and ground.slope_sd is not None:
        steep = (np.abs(ground.slope) > STEEP) & (np.abs(ground.slope) > 3 * ground.slope_sd)
        if np.any(steep):
            found.append(
                f"the contacts slope by {ground.slope[0]:+.3f} along x and {ground.slope[1]:+.3f} along y: "
                "the camera or the floor is tilted; the tilt is reported and not applied"
            )
    return tuple(found)

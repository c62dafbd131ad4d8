"""The state of a run as the groups of `schemas/estimate.py`."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.estimate.camera_groups import camera_groups
from r2s2r_cli.stages.estimate.lengths import cap_distances
from r2s2r_cli.stages.estimate.rigid import angular_velocities, axes, orientations
from r2s2r_cli.stages.estimate.run import RunState
from r2s2r_cli.stages.estimate.smooth import whiteness
from r2s2r_cli.stages.init.attachment import rod_frames

CARRIED = ("commands", "policy")
"""Groups of a recording that later stages need with the states; they are copied as they are."""


def run_groups(state: RunState) -> dict[str, Group]:
    """Groups of one run by path."""
    made = {"": state.streams[""], "ground": _ground(state), "frames": _frames(state), "tracks": _tracks(state)}
    made.update({name: state.streams[name] for name in CARRIED if name in state.streams})
    if state.intervals is not None:
        made["intervals"] = state.intervals.to_group()
    if state.segments is not None:
        made["segments"] = state.segments.to_group()
    if state.camera is not None:
        made.update(camera_groups(state.camera, state.ground.shift))
    return {f"runs/{state.run}/{name}".rstrip("/"): group for name, group in made.items()}


def _ground(state: RunState) -> Group:
    ground = state.ground
    unknown = np.full(2, np.nan)
    return Group(
        {
            "normal": np.array([0.0, 0.0, 1.0]),
            "slope": unknown if ground.slope is None else ground.slope,
            "slope_sd": unknown if ground.slope_sd is None else ground.slope_sd,
        },
        {
            "offset": -ground.shift,
            "offset_sd": ground.shift_sd,
            "shift": ground.shift,
            "tilt_known": ground.slope is not None,
            **({} if state.height_error is None else {"height_error": state.height_error}),
        },
    )


def _frames(state: RunState) -> Group:
    rods, tracks, p_WE = state.rods, state.tracks, state.p_WE
    u = axes(p_WE)
    rod_length = np.array([rod.length_m for rod in state.robot.rods])
    caps = np.array([cable.caps for cable in state.robot.cables])
    length, length_sd = cap_distances(p_WE, rods.cov_p, caps)
    if state.camera is not None:  # its caps are correlated, and known to be
        length_sd = state.camera.tracked.length_sd
    cov_p = rods.cov_p.copy()
    cov_p[:, :, 2, 2] += state.ground.shift_sd**2
    datasets = {
        "t": state.t,
        "source_frame": state.kept.astype(np.int64),
        "p_WE": p_WE,
        "cov_p_WE": cov_p,
        "v_WE": rods.v_WE,
        "sd_v_WE": np.sqrt(np.diagonal(rods.cov_v, axis1=2, axis2=3)),
        "p_WR": 0.5 * (p_WE[:, 0::2] + p_WE[:, 1::2]),
        "q_WR": orientations(u, rod_frames(p_WE[0])),
        "v_WR": 0.5 * (rods.v_WE[:, 0::2] + rods.v_WE[:, 1::2]),
        "w_WR": angular_velocities(u, rods.v_WE, rod_length),
        "quality": tracks.quality,
        "score": tracks.score,
        "contact": state.contact,
        "contact_probability": state.probability,
        "length": length,
        "length_sd": length_sd,
    }
    if state.camera is not None:
        datasets["mode"] = state.camera.tracked.mode.astype(np.uint8)
    if state.sensors is not None:
        datasets["sensor_length"] = state.sensors.length
        datasets["sensor_cable"] = state.sensors.cable
    return Group(datasets, {"source_rigid": bool(np.all(state.rigid)), "roll_observable": False})


def innovations(state: RunState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean square over variance, lag-1 correlation and whether that is 0; each of shape (cap,).

    Camera images: of sightings against smoothed caps; the mean square is that of `score`, without what neighbouring
    sightings share, which the correlation shows.
    """
    variance, lag1, white = whiteness(state.tracks.innovation)
    if state.camera is None:
        return variance, lag1, white
    used = np.isfinite(state.tracks.innovation).all(axis=2) & np.isfinite(state.tracks.score)
    square = np.where(used, np.nan_to_num(state.tracks.score) ** 2, 0.0)
    return np.sum(square, axis=0) / np.maximum(np.sum(used, axis=0), 1), lag1, white


def _tracks(state: RunState) -> Group:
    variance, lag1, white = innovations(state)
    known = {}
    if state.camera is not None:
        swept = state.camera.swept
        known = {"observed": swept.known + np.array([0.0, 0.0, state.ground.shift]), "observed_sd": swept.known_sd}
    return Group(
        {
            **known,
            "noise_sd": state.noise,
            "held": state.held,
            "speed_change": np.sqrt(state.tracks.density),
            "innovation_variance": variance,
            "innovation_lag1": lag1,
            "white": white,
        }
    )

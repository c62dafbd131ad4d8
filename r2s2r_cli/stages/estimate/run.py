"""One run through the estimate: observed caps in, states out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.contacts import contact_probability, contacts, height_error
from r2s2r_cli.stages.estimate.ground import Ground, find_ground
from r2s2r_cli.stages.estimate.lasting import lasting
from r2s2r_cli.stages.estimate.lengths import SensorLengths, sensor_lengths
from r2s2r_cli.stages.estimate.noise import observation_noise
from r2s2r_cli.stages.estimate.rigid import Rods, is_rigid, make_rigid
from r2s2r_cli.stages.estimate.smooth import MIN_FRAMES, OUTLIER, Tracks, smooth, switched
from r2s2r_cli.stages.estimate.unseen import Unseen
from r2s2r_cli.stages.frames import KEPT, fit_rod_length
from r2s2r_cli.stages.segments import Intervals, Segments, hidden_targets, segments, target_intervals
from schemas.estimate import EstimateSettings
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.stages.estimate.camera_run import CameraFacts


@dataclass(frozen=True)
class RunState:
    """Everything that is known of one run. `observed`, `tracks` and `rods` are in the frame of the recording; in a run
    of camera images in that of the ground as it is seen, and `observed` has NaN where a cap was not seen."""

    run: str
    streams: dict[str, Group]
    robot: Robot
    kept: np.ndarray
    """Rows of the recording's caps, or of its camera, shape (frame,)."""
    t: np.ndarray
    observed: np.ndarray
    """[m], shape (frame, cap, 3)."""
    noise: np.ndarray
    held: np.ndarray
    tracks: Tracks
    rods: Rods
    rigid: np.ndarray
    """Whether the source had made the rod rigid, shape (rod,)."""
    ground: Ground
    p_WE: np.ndarray
    """End caps in the world, ground at z = 0 [m], shape (frame, cap, 3)."""
    height_error: float | None
    """Of the tracker, beyond its noise [m]; None where the robot does not stand on three caps."""
    probability: np.ndarray
    contact: np.ndarray
    intervals: Intervals | None
    segments: Segments | None
    sensors: SensorLengths | None
    camera: CameraFacts | None = None
    """Of a run of camera images; None where the recording brought the caps."""


def estimate_run(run: str, streams: dict[str, Group], robot: Robot, settings: EstimateSettings) -> RunState:
    """See `estimate`."""
    kept, t, observed = observations(run, streams)
    check_robot(run, observed, robot, settings)
    noise, held = observation_noise(t, observed, streams["caps"], where=f"runs/{run}/caps")
    rigid = is_rigid(observed, noise)
    if not rigid.any():
        noise = noise * lasting(t, observed, noise)
    intervals, parts = _intervals(run, streams, t)
    tracks = smooth(
        t,
        observed,
        noise,
        changes=switches(streams, t),
        kick_m_per_s=settings.switch_kick_m_per_s,
        gate=settings.gate_probability,
    )
    length = np.array([rod.length_m for rod in robot.rods])
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    rods = make_rigid(tracks.p_WE, tracks.cov_p, tracks.v_WE, tracks.cov_v, length, ~rigid)
    ground = find_ground(observed, tracks.quality != OUTLIER, radius)
    p_WE = rods.p_WE + np.array([0.0, 0.0, ground.shift])
    height = p_WE[:, :, 2] - radius
    error = height_error(height)
    probability = contact_probability(
        height,
        np.sqrt(rods.cov_p[:, :, 2, 2] + ground.shift_sd**2 + (error or 0.0) ** 2),
        rods.v_WE[:, :, 2],
        np.sqrt(rods.cov_v[:, :, 2, 2]),
        clearance=settings.contact_clearance_m,
        lift=settings.contact_lift_m_per_s,
    )
    return RunState(
        run=run, streams=streams, robot=robot, kept=kept, t=t, observed=observed, noise=noise, held=held, tracks=tracks,
        rods=rods, rigid=rigid, ground=ground, p_WE=p_WE, height_error=error, probability=probability,
        contact=contacts(probability), intervals=intervals, segments=parts,
        sensors=sensor_lengths(t, streams["sensors"], robot, settings.sensor_gap_s) if "sensors" in streams else None,
    )  # fmt: skip


def observations(run: str, streams: dict[str, Group]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, stamps [s] and end caps [m] of the kept frames. Raises InputError where these allow no estimate."""
    if "caps" not in streams:
        held = ", ".join(name for name in streams if name) or "nothing"
        raise Unseen(
            f"run {run} holds neither observed end caps nor camera images",
            where=f"runs/{run}/caps",
            expected="end caps, as a trajectory CSV brings them, or a camera with colour and depth",
            received=held,
            hint="r2s2r import crawl.csv",
        )
    caps = streams["caps"]
    kept = np.flatnonzero(caps["drop_reason"] == KEPT)
    t, p_WE = caps["t"][kept], caps["p_WE"][kept]
    if len(kept) < MIN_FRAMES:
        raise InputError(
            f"run {run} has too few frames to estimate a state",
            where=f"runs/{run}/caps",
            expected=f"at least {MIN_FRAMES} kept frames",
            received=f"{len(kept)} of {len(caps['t'])} rows were kept",
            hint="r2s2r inspect 10-record.h5   # shows drop_reason, why a row was left out",
        )
    if not (np.all(np.isfinite(p_WE)) and np.all(np.isfinite(t)) and np.all(np.diff(t) > 0)):
        raise InputError(
            f"run {run} has kept frames that cannot be used: not finite, or stamps that do not increase",
            where=f"runs/{run}/caps",
            expected="finite end caps and increasing stamps wherever drop_reason is 0",
            received=f"{int(np.sum(~np.isfinite(p_WE)))} coordinates not finite, "
            f"{int(np.sum(~(np.diff(t) > 0)))} stamps not after the one before",
            hint="r2s2r import crawl.csv --force   # the log again",
        )
    return kept, t, p_WE


def check_robot(run: str, observed: np.ndarray, robot: Robot, settings: EstimateSettings) -> None:
    """Raises InputError where the observed caps are not those of the robot."""
    if observed.shape[1] != robot.n_caps:
        raise InputError(
            f"run {run} has another number of end caps than robot {robot.name}",
            where=f"runs/{run}/caps/p_WE",
            expected=f"{robot.n_caps} end caps",
            received=f"{observed.shape[1]}",
            hint="estimate with the robot.toml of the robot that was recorded",
        )
    seen, _ = fit_rod_length(observed)
    length = np.array([rod.length_m for rod in robot.rods])
    wrong = np.abs(seen - length) > settings.rod_length_tolerance * length
    if np.any(wrong):
        rod = int(np.argmax(wrong))
        raise InputError(
            f"rod {rod} of run {run} has another length than in robot.toml",
            where=f"runs/{run}/caps/p_WE",
            expected=f"{1e3 * length[rod]:.1f} mm between the cap centres, within {settings.rod_length_tolerance:.0%}",
            received=f"{1e3 * seen[rod]:.1f} mm",
            hint="set rods.length_m in robot.toml to the robot that was recorded, cap centre to cap centre",
        )


def _intervals(run: str, streams: dict[str, Group], t: np.ndarray) -> tuple[Intervals | None, Segments | None]:
    """Those of the recording; else from its commands, each frame under the last command before it."""
    if "intervals" in streams:
        found = Intervals.from_group(streams["intervals"])
        if len(found) and (np.max(found.last) >= len(t) or np.min(found.first) < 0):
            raise InputError(
                f"the target intervals of run {run} count more frames than were kept",
                where=f"runs/{run}/intervals/last",
                expected=f"at most {len(t) - 1}",
                received=str(int(np.max(found.last))),
                hint="r2s2r import crawl.csv --force   # the log again",
            )
        return found, Segments.from_group(streams["segments"]) if "segments" in streams else None
    return intervals_of(streams, t)


def intervals_of(streams: dict[str, Group], t: np.ndarray) -> tuple[Intervals | None, Segments | None]:
    """Intervals and segments of the frames at t [s] from the commands; None where there are none."""
    target, control = _commanded(streams, t)
    if target is None:
        return None, None
    commands = streams["commands"]
    hidden = hidden_targets(t, commands["t"], commands["target"])
    found = target_intervals(t, target, control=control, hidden=hidden)
    return found, segments(found, t, control)


def switches(streams: dict[str, Group], t: np.ndarray) -> np.ndarray:
    """Gaps between frames in which a motor was switched on, off or round, or (control not logged) a target changed.

    A target moves nothing by itself and is seen up to a frame before the motion: then the gap after it counts, too.
    """
    target, control = _commanded(streams, t)
    if target is None:
        return np.zeros(0, dtype=np.int64)
    if control is None:
        changed = np.flatnonzero(np.any(np.diff(np.nan_to_num(target, nan=-1.0), axis=0) != 0, axis=1))
        return np.unique(np.clip(np.concatenate([changed, changed + 1]), 0, len(t) - 2))
    return switched(control)


def _commanded(streams: dict[str, Group], t: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Target and control at each frame: those of the last command before it; None where there are none."""
    if "commands" not in streams or not len(streams["commands"]["t"]):
        return None, None
    commands = streams["commands"]
    row = np.searchsorted(commands["t"], t, side="right") - 1
    before = (row < 0)[:, None]
    target = np.where(before, np.nan, commands["target"][np.maximum(row, 0)])
    control = np.where(before, np.nan, commands["control"][np.maximum(row, 0)]) if "control" in commands else None
    return target, control

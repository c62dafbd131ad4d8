"""How far an estimate of `bench estimate` is from the truth: the measures of the published evaluation, and ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from schemas.results_estimate_bench import TrackScore

if TYPE_CHECKING:
    from r2s2r_cli.artifact import Group
    from r2s2r_cli.commands.bench_estimate_case import Case, Truth
    from schemas.robot import Robot

CHI2_95 = 7.8147
"""95 % of squared normalised errors in three dimensions lie below."""
WITHIN_M, WITHIN_DEG = 0.02, 5.0
"""Of the published evaluation (arXiv 2205.14764, `pose_error_analysis_all.py`)."""
LOST_M = 0.05
WEIGHT_SHARE, NEAR_M = 0.05, 0.001
"""A cap carries weight above this share of all; nearer to the ground than this and without, it is neither."""


@dataclass(frozen=True)
class Errors:
    """One run, frame by frame, so that runs can be put together. cap, com [m], axis [deg], squared: normalised squared
    error; contact, touching, counted: estimated and true contact, and whether it counts, (frame, cap). delay_s:
    estimated minus true delay, None where it is said to be unknown. sensors: whether the run has any. floor_m,
    floor_rad: by how much the floor is taken for too far from the camera, and its tilt."""

    cap: np.ndarray
    rod: np.ndarray
    axis: np.ndarray
    com: np.ndarray
    squared: np.ndarray
    contact: np.ndarray
    touching: np.ndarray
    counted: np.ndarray
    delay_s: float | None
    sensors: bool
    floor_m: float
    floor_rad: float
    sensor_m: float | None
    recovery_s: float | None
    wall_s: float
    cpu_s: float
    memory_mb: float


def errors_of(case: Case, groups: Mapping[str, Group], *, wall_s: float, cpu_s: float, memory_mb: float) -> Errors:
    """groups: of the estimate, by stream. Where an estimate's world has its origin on the floor and where its x axis
    points is a choice, which `same_axes` takes away; heights and the tilt of the floor are none."""
    frames, truth = groups["frames"], case.truth
    rows = frames["source_frame"]
    X_WC = groups["camera"]["X_WC"]
    R, shift = same_axes(X_WC, truth)
    p_WE = frames["p_WE"] @ R.T + shift
    true, off = truth.p_WE[rows], p_WE - truth.p_WE[rows]
    cov = R @ frames["cov_p_WE"] @ R.T
    squared = np.einsum("tci,tcij,tcj->tc", off, np.linalg.inv(cov), off)
    radius = np.repeat([rod.cap_radius_m for rod in case.robot.rods], 2)
    force = truth.force[rows] > WEIGHT_SHARE * truth.weight
    near = true[..., 2] - radius < NEAR_M
    cap = np.linalg.norm(off, axis=-1)
    return Errors(
        cap=cap, rod=np.linalg.norm(off[:, 0::2] + off[:, 1::2], axis=-1) / 2, axis=_angles(p_WE, true),
        com=np.linalg.norm(_centre(p_WE, case.robot) - _centre(true, case.robot), axis=-1), squared=squared,
        contact=frames["contact"], touching=force, counted=force | ~near, delay_s=_delay(groups, truth),
        sensors="sensors" in case.streams, floor_m=float(X_WC[2, 3] - truth.X_WC[2, 3]),
        floor_rad=float(np.arccos(np.clip(X_WC[2, :3] @ truth.X_WC[2, :3], -1.0, 1.0))),
        sensor_m=_sensor(frames, groups, truth, rows),
        recovery_s=_recovery(frames["t"], cap, truth.blind[rows]), wall_s=wall_s, cpu_s=cpu_s,
        memory_mb=memory_mb,
    )  # fmt: skip


def same_axes(X_WC: np.ndarray, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Turn about z (3, 3) and move along the floor (3,) that take an estimate's world to the rig's.

    By the camera, which both know: its heading is the same in both, and the point of the true floor on which the robot
    was on average lies where its line of sight meets the estimate's floor. Caps of the estimate play no part.
    """
    both = truth.X_WC[:3, :3] @ X_WC[:3, :3].T
    yaw = np.arctan2(both[1, 0] - both[0, 1], both[0, 0] + both[1, 1])
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    middle = truth.p_WE.mean(axis=(0, 1)) * np.array([1.0, 1.0, 0.0])
    ray = X_WC[:3, :3] @ truth.X_WC[:3, :3].T @ (middle - truth.X_WC[:3, 3])
    seen = X_WC[:3, 3] - ray * X_WC[2, 3] / ray[2]
    return R, middle - R @ seen


def summed_up(runs: Sequence[Errors], failed: Sequence[int] = ()) -> TrackScore:
    """The figures of some runs together. failed: frames of every run that could not be tracked; in these the robot is
    lost, within nothing and covered by nothing."""
    cap, rod, axis, com = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("cap", "rod", "axis", "com")
    )
    hit = sum(int(np.sum(run.contact & run.touching & run.counted)) for run in runs)
    wrong = sum(int(np.sum((run.contact != run.touching) & run.counted)) for run in runs)
    delays = [abs(run.delay_s) for run in runs if run.delay_s is not None]
    sensors = [run.sensor_m for run in runs if run.sensor_m is not None]
    recoveries = [run.recovery_s for run in runs if run.recovery_s is not None]
    count, missed = len(cap), sum(failed)
    tracked = count / (count + missed)
    return TrackScore(
        runs=len(runs) + len(failed), failed=len(failed), frames=count,
        cap_mean_mm=1e3 * float(cap.mean()), cap_p95_mm=1e3 * float(np.percentile(cap, 95)),
        cap_max_mm=1e3 * float(cap.max()), rod_mean_mm=1e3 * float(rod.mean()), axis_mean_deg=float(axis.mean()),
        axis_p95_deg=float(np.percentile(axis, 95)),
        within=tracked * float(np.mean((rod < WITHIN_M) & (axis < WITHIN_DEG))),
        com_mean_mm=1e3 * float(com.mean()),
        covered=tracked * float(np.mean(np.concatenate([run.squared for run in runs]) < CHI2_95)),
        lost=(float(np.sum(cap.max(axis=1) > LOST_M)) + missed) / (count + missed),
        contact_f1=2 * hit / (2 * hit + wrong) if hit + wrong else None,
        delay_error_ms=1e3 * max(delays) if delays else None,
        delay_unknown=sum(run.sensors and run.delay_s is None for run in runs),
        floor_mm=1e3 * max(abs(run.floor_m) for run in runs),
        floor_deg=float(np.degrees(max(run.floor_rad for run in runs))),
        sensor_error_mm=1e3 * float(np.mean(sensors)) if sensors else None,
        recovery_s=max(recoveries) if recoveries else None,
        frames_per_s=len(cap) / sum(run.wall_s for run in runs),
        cpu_ms=1e3 * sum(run.cpu_s for run in runs) / len(cap), memory_mb=max(run.memory_mb for run in runs),
    )  # fmt: skip


def _angles(p_WE: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angle between axes [deg], (frame, rod)."""
    a, b = p_WE[:, 1::2] - p_WE[:, 0::2], true[:, 1::2] - true[:, 0::2]
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(cross, np.sum(a * b, axis=-1))))


def _centre(p_WE: np.ndarray, robot: Robot) -> np.ndarray:
    """Centre of mass [m], (frame, 3)."""
    mass = np.array([sum(part.mass_kg for part in rod.parts) for rod in robot.rods])
    moment = np.array([sum(part.mass_kg * part.offset_m for part in rod.parts) for rod in robot.rods])
    share = 0.5 + moment / mass / np.array([rod.length_m for rod in robot.rods])
    even, odd = p_WE[:, 0::2], p_WE[:, 1::2]
    return np.einsum("r,tri->ti", mass / mass.sum(), even + share[:, None] * (odd - even))


def _delay(groups: Mapping[str, Group], truth: Truth) -> float | None:
    fit = groups.get("sensor_fit")
    if fit is None or not fit.attributes["delay_known"]:
        return None
    return float(fit.attributes["delay"]) - truth.delay_s


def _sensor(frames: Group, groups: Mapping[str, Group], truth: Truth, rows: np.ndarray) -> float | None:
    if "sensor_length" not in frames or "sensor_fit" not in groups:
        return None
    shown = frames["sensor_length"] - groups["sensor_fit"]["bias"]
    off = shown - truth.length[rows][:, frames["sensor_cable"]]
    return float(np.mean(np.abs(np.nanmean(off, axis=0))))


def _recovery(t: np.ndarray, cap: np.ndarray, blind: np.ndarray) -> float | None:
    """From the last blind frame until every cap is within WITHIN_M for good, or the end of the run."""
    if not blind.any():
        return None
    end = int(np.flatnonzero(blind)[-1])
    bad = np.flatnonzero(cap[end:].max(axis=1) > WITHIN_M)
    return float(t[end + bad[-1]] - t[end]) if len(bad) else 0.0

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
    error; contact, touching, counted: estimated and true contact, and whether it counts, (frame, cap)."""

    cap: np.ndarray
    rod: np.ndarray
    axis: np.ndarray
    com: np.ndarray
    squared: np.ndarray
    contact: np.ndarray
    touching: np.ndarray
    counted: np.ndarray
    delay_s: float | None
    sensor_m: float | None
    recovery_s: float | None
    wall_s: float
    cpu_s: float
    memory_mb: float


def errors_of(case: Case, groups: Mapping[str, Group], *, wall_s: float, cpu_s: float, memory_mb: float) -> Errors:
    """groups: of the estimate, by stream. Estimates are taken to the camera by their own X_WC, and from there to the
    rig's world by the true one, because where x and y of an estimate's world lie is a choice."""
    frames, truth = groups["frames"], case.truth
    rows = frames["source_frame"]
    R = truth.X_WC[:3, :3] @ groups["camera"]["X_WC"][:3, :3].T
    p_WC = groups["camera"]["X_WC"][:3, 3]
    p_WE = (frames["p_WE"] - p_WC) @ R.T + truth.X_WC[:3, 3]
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
        sensor_m=_sensor(frames, groups, truth, rows),
        recovery_s=_recovery(frames["t"], cap, truth.blind[rows]), wall_s=wall_s, cpu_s=cpu_s,
        memory_mb=memory_mb,
    )  # fmt: skip


def summed_up(runs: Sequence[Errors]) -> TrackScore:
    """The figures of some runs together."""
    cap, rod, axis, com = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("cap", "rod", "axis", "com")
    )
    hit = sum(int(np.sum(run.contact & run.touching & run.counted)) for run in runs)
    wrong = sum(int(np.sum((run.contact != run.touching) & run.counted)) for run in runs)
    delays = [abs(run.delay_s) for run in runs if run.delay_s is not None]
    sensors = [run.sensor_m for run in runs if run.sensor_m is not None]
    recoveries = [run.recovery_s for run in runs if run.recovery_s is not None]
    return TrackScore(
        frames=len(cap), cap_mean_mm=1e3 * float(cap.mean()), cap_p95_mm=1e3 * float(np.percentile(cap, 95)),
        cap_max_mm=1e3 * float(cap.max()), rod_mean_mm=1e3 * float(rod.mean()), axis_mean_deg=float(axis.mean()),
        axis_p95_deg=float(np.percentile(axis, 95)), within=float(np.mean((rod < WITHIN_M) & (axis < WITHIN_DEG))),
        com_mean_mm=1e3 * float(com.mean()),
        covered=float(np.mean(np.concatenate([run.squared for run in runs]) < CHI2_95)),
        lost=float(np.mean(cap.max(axis=1) > LOST_M)),
        contact_f1=2 * hit / (2 * hit + wrong) if hit + wrong else None,
        delay_error_ms=1e3 * max(delays) if delays else None,
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

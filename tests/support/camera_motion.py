"""Runs of the rig's plant under a gait, with the truth at any time, and noisy sightings and sensor lengths of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.estimate.motion.data import Readings, Sighted
from schemas.robot import Robot
from tests.support.rig_robots import known

FRAME_S = 1 / 30
SAMPLE_S = 1 / 50
LATERAL_M, DEPTH_M = 5e-4, 1.5e-3


@dataclass(frozen=True)
class Motion:
    """Truth at even steps. p_WE: (step, cap, 3) [m]; normal: force of the ground over the weight, (step, cap)."""

    t: np.ndarray
    p_WE: np.ndarray
    normal: np.ndarray
    robot: Robot

    def at(self, t: np.ndarray) -> np.ndarray:
        """Caps at any times, linear in between, shape (..., cap, 3)."""
        flat = self.p_WE.reshape(len(self.t), -1)
        columns = [np.interp(t, self.t, column) for column in flat.T]
        return np.stack(columns, axis=-1).reshape(*np.shape(t), *self.p_WE.shape[1:])

    def lengths(self, t: np.ndarray) -> np.ndarray:
        """Distances of cap centres of every cable, shape (..., cable)."""
        ends = np.array([cable.caps for cable in self.robot.cables])
        p = self.at(t)
        return np.linalg.norm(p[..., ends[:, 1], :] - p[..., ends[:, 0], :], axis=-1)


def motion(seed: int, seconds: float, *, step_s: float = 0.01, gait_s: float = 1.2, rest_s: float = 0.5) -> Motion:
    """A robot that starts at rest and goes for a new random target shape every `gait_s`."""
    robot = known()
    plant = Plant(robot, World.model_validate({"start": {"settle_s": 1.0}, "seed": seed}))
    rng = np.random.default_rng(seed)
    weight = 9.81 * sum(part.mass_kg for rod in robot.rods for part in rod.parts)
    low, span = robot.pid.min_length_m, robot.pid.range_m
    caps, normal = [], []
    target: np.ndarray = np.ones(len(robot.actuated))
    sign = np.array([motor.sign for motor in robot.motors], dtype=float)
    order = [robot.actuated.index(motor.cable) for motor in robot.motors]
    steps = round(seconds / step_s)
    for k in range(steps + 1):
        truth = plant.truth()
        caps.append(truth.p_WE)
        normal.append(truth.force[:, 2] / weight)
        if k * step_s >= rest_s and (k - round(rest_s / step_s)) % round(gait_s / step_s) == 0:
            target = rng.integers(0, 2, len(target)) * 0.9 + 0.05
        error = (truth.length[list(robot.actuated)] - low) / span - target
        u = np.where(np.abs(error) < 0.05, 0.0, np.clip(6 * error, -1, 1))
        plant.advance(step_s, sign * u[order] * np.array([motor.speed for motor in robot.motors]))
    return Motion(step_s * np.arange(steps + 1), np.array(caps), np.array(normal), robot)


def sighted(truth: Motion, rng: np.random.Generator, *, height_m: float = 1.44, scale: float = 1.0) -> Sighted:
    """Every cap in every frame of a camera that looks down from `height_m`: noise across and along its rays."""
    t = np.arange(0.0, truth.t[-1], FRAME_S)
    p = truth.at(t)
    ray = p - [0.0, 0.0, height_m]
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    along = ray[..., :, None] * ray[..., None, :]
    cov = LATERAL_M**2 * (np.eye(3) - along) + DEPTH_M**2 * along
    white = rng.standard_normal(p.shape)
    depth = np.sum(white * ray, axis=-1, keepdims=True)
    noise = LATERAL_M * white + (DEPTH_M - LATERAL_M) * depth * ray
    return Sighted(t, p + scale * noise, cov)


def readings(
    truth: Motion, rng: np.random.Generator, *, bias: np.ndarray | None = None, noise_m: float = 3e-3,
    lag_s: float = 0.03, offset_s: float = 0.0,
) -> tuple[Readings, np.ndarray]:  # fmt: skip
    """Sensors with a first-order lag, an offset each (given back, default 4 mm) and stamps `offset_s` late."""
    fine = np.arange(-1.0, truth.t[-1], 0.002)
    length = truth.lengths(fine)
    lagged = np.empty_like(length)
    lagged[0] = length[0]
    keep = np.exp(-0.002 / lag_s) if lag_s > 0 else 0.0
    for k in range(1, len(fine)):
        lagged[k] = keep * lagged[k - 1] + (1 - keep) * length[k]
    t = np.arange(0.0, truth.t[-1], SAMPLE_S) + 0.003
    shown = np.column_stack([np.interp(t, fine, column) for column in lagged.T])
    planted: np.ndarray = 4e-3 * np.asarray(rng.standard_normal(length.shape[1])) if bias is None else bias
    shown = shown + planted + noise_m * rng.standard_normal(shown.shape)
    return Readings(t + offset_s, shown, np.arange(shown.shape[1])), planted

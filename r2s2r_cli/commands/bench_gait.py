"""What both simulators of `bench engine` are given: one robot, one random binary gait, and ten parameters to vary."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from schemas.robot import Robot

TICK_S = 0.02
"""A motor command is held so long, one period of the robot's controller."""
TARGET_S = 1.0
"""So long a target holds."""

Edit = Callable[[dict[str, Any], float], None]


def commands(robot: Robot, speed: np.ndarray, seconds: float, seeds: range) -> np.ndarray:
    """Motor commands in [-1, 1], +1 reels in, (seed, tick, actuated), of random binary gaits.

    Every second each winched cable is told to be long, as in the rest pose, or shorter by half of its range, and its
    winch runs there at full speed. speed: of the winches [m/s].
    """
    ticks, held = round(seconds / TICK_S), round(TARGET_S / TICK_S)
    reel = speed * TICK_S
    found = np.empty((len(seeds), ticks, len(speed)))
    for row, seed in zip(found, seeds, strict=True):
        bits = np.random.default_rng(seed).integers(0, 2, size=(-(-ticks // held), len(speed)))
        reeled = np.zeros(len(speed))
        for k in range(ticks):
            row[k] = np.clip((0.5 * robot.pid.range_m * bits[k // held] - reeled) / reel, -1.0, 1.0)
            reeled = reeled + reel * row[k]
    return found


def reeled_in(u: np.ndarray, speed: np.ndarray, step_s: float) -> np.ndarray:
    """Length that every winch has reeled in at the start of every step [m], (seed, step, actuated)."""
    each = np.repeat(u * speed * step_s, round(TICK_S / step_s), axis=1)
    return np.concatenate([np.zeros_like(each[:, :1]), np.cumsum(each, axis=1)[:, :-1]], axis=1)


def parameters() -> tuple[str, ...]:
    """Names of the ten parameters."""
    return tuple(_EDITS)


def varied(robot: Robot, name: str, factor: float) -> Robot:
    """The robot with one parameter multiplied by `factor`."""
    values = robot.model_dump()
    _EDITS[name](values, factor)
    return Robot.model_validate(values)


def _cables(values: dict[str, Any], kind: str) -> Iterator[dict[str, Any]]:
    return (cable for cable in values["cables"] if cable["kind"] == kind)


def _scale_cables(kind: str, key: str) -> Edit:
    def edit(values: dict[str, Any], factor: float) -> None:
        for cable in _cables(values, kind):
            cable[key] *= factor

    return edit


def _scale_parts(shapes: tuple[str, ...]) -> Edit:
    def edit(values: dict[str, Any], factor: float) -> None:
        for rod in values["rods"]:
            for part in rod["parts"]:
                part["mass_kg"] *= factor if part["shape"] in shapes else 1.0

    return edit


def _scale_friction(values: dict[str, Any], factor: float) -> None:
    values["contact"]["friction"] *= factor


def _scale_speed(values: dict[str, Any], factor: float) -> None:
    for motor in values["motors"]:
        motor["speed"] *= factor


def _scale_attachment(values: dict[str, Any], factor: float) -> None:
    for cable in values["cables"]:
        cable["sites_m"] = tuple((x * factor, y * factor, z) for x, y, z in cable["sites_m"])


_EDITS: dict[str, Edit] = {
    "friction": _scale_friction,
    "motor speed": _scale_speed,
    "attachment radius": _scale_attachment,
    "mass of spheres": _scale_parts(("sphere", "point")),
    "mass of tubes and cylinders": _scale_parts(("tube", "cylinder")),
    "stiffness, actuated": _scale_cables("actuated", "stiffness_n_per_m"),
    "damping, actuated": _scale_cables("actuated", "damping_n_s_per_m"),
    "stiffness, passive": _scale_cables("passive", "stiffness_n_per_m"),
    "damping, passive": _scale_cables("passive", "damping_n_s_per_m"),
    "rest length, passive": _scale_cables("passive", "rest_length_m"),
}

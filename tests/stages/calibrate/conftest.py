"""The robot that is calibrated, and texts of what was measured."""

from __future__ import annotations

import tomllib
from collections.abc import Callable

import numpy as np
import pytest

from r2s2r_cli.stages.calibrate import Source
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

HEADER = "set,sensor_id,length_mm,capacitance_pF"


@pytest.fixture(scope="session")
def robot_text() -> str:
    """robot.toml of the 3-bar robot, as `init` writes it."""
    return robot_toml("threebar")


@pytest.fixture(scope="session")
def robot(robot_text: str) -> Robot:
    """The 3-bar robot: nine sensors."""
    return Robot.model_validate(tomllib.loads(robot_text))


@pytest.fixture
def points_text() -> Callable[..., str]:
    """Makes a points table: planted lines for nine sensors, `edit` changes single rows (None drops one)."""

    def make(
        sets: tuple[str, ...] = ("one",),
        slope: float = 0.03,
        offset: float = 16.0,
        lengths: tuple[float, ...] = (100.0, 120.0, 140.0, 160.0, 180.0),
        flat: tuple[int, ...] = (),
    ) -> str:
        rows = [HEADER]
        for name in sets:
            for sensor in range(9):
                for length in lengths:
                    value = offset + sensor / 8 + (0.0 if sensor in flat else slope * length)
                    rows.append(f"{name},{sensor},{length},{value:.6f}")
        return "\n".join(rows) + "\n"

    return make


def source(text: str, name: str = "points.csv") -> Source:
    """A text as the file it would have come from."""
    return Source(name, text.encode())


def cubic_text(ks: np.ndarray, x_max: float = 0.1, n: int = 21) -> str:
    """A table of exact cubic curves, in millimetres and newtons."""
    rows = ["curve,displacement_mm,force_N"]
    for i, (k1, k2, k3) in enumerate(ks):
        for x in np.linspace(0, x_max, n):
            rows.append(
                f"t{i},{1e3 * x!r},{k1 * x + k2 * x**2 + k3 * x**3!r}".replace("np.float64(", "").replace(")", "")
            )
    return "\n".join(rows) + "\n"

"""A camera that is knocked: found at its size and time; walking, falling and noise are none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.knocks import Knock, knock
from r2s2r_cli.stages.diagnose.parity.series import Series
from tests.support.robots import subject

RATE_HZ, LASTS_S = 10.0, 24.0


def walked(seed: int, noise_m: float = 0.002, name: str = "a") -> SimpleNamespace:
    """The caps of a robot at rest pose that are carried about and swing by centimetres, as in a gait."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, LASTS_S, 1.0 / RATE_HZ)
    rest = np.array(subject("threebar").robot.rest_caps_m)
    phase, place = rng.uniform(0.0, 6.0, (6, 3)), 0.08 * np.cumsum(rng.standard_normal(2)) / 4
    swing = 0.02 * np.sin(2 * np.pi * t[:, None, None] / 5.0 + phase)
    p = rest + swing + np.append(place, 0.0) * np.sin(t / 7.0)[:, None, None]
    return SimpleNamespace(name=name, t=t, p_WE=p + noise_m * rng.standard_normal(p.shape))


def found(*runs: SimpleNamespace) -> Knock:
    """Of them all."""
    made: list[Series] = list(runs)  # type: ignore[arg-type]
    one = knock(made)
    assert one is not None
    return one


def turned(p: np.ndarray, turn_rad: tuple[float, float, float], by_m: tuple[float, float]) -> np.ndarray:
    """By a small rotation vector about the world's origin, and a shift."""
    return np.asarray(p + np.cross(turn_rad, p) + np.array([*by_m, 0.0]))


@pytest.mark.parametrize("noise_m", [0.002, 0.005])
def test_a_knock_is_found_at_its_size_and_time(noise_m: float) -> None:
    """In the second run, in mid-gait: two degrees about the vertical and 2 cm; afterwards the camera stays there."""
    first, second = walked(1, noise_m), walked(2, noise_m, "b")
    at = 11.24
    late = second.t > at
    moved = turned(second.p_WE[late], (0.01, -0.015, 0.03), (0.02, -0.01))
    size = float(np.linalg.norm((moved - second.p_WE[late])[0].mean(axis=0)))
    second.p_WE[late] = moved
    one = found(first, second)
    assert one.run == "b" and abs(one.t - at) <= 1.0 / RATE_HZ
    assert one.size.value > 5 * one.size.sd and abs(one.whole - size) < 4 * one.size.sd


@pytest.mark.parametrize("noise_m", [0.0005, 0.002, 0.01])
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_walk_is_none(seed: int, noise_m: float) -> None:
    """Nor is noise: within two of its errors of nothing."""
    one = found(walked(seed, noise_m), walked(seed + 20, noise_m, "b"))
    assert one.size.value <= 2 * one.size.sd


def test_a_robot_that_falls_is_none() -> None:
    """Three caps stay where they are, the others swing over by 8 cm within two frames."""
    run = walked(6)
    run.p_WE[run.t > 9.0, ::2, :2] += (0.08, 0.03)
    assert found(run).size.value < 0.005


def test_a_knock_is_found_by_the_caps_that_are_seen() -> None:
    """Frames and one cap may be missing, but not half of the caps."""
    run = walked(7)
    run.p_WE[run.t > 11.24] = turned(run.p_WE[run.t > 11.24], (0.0, 0.0, 0.03), (0.03, 0.0))
    rng = np.random.default_rng(8)
    run.p_WE[rng.random(run.p_WE.shape[:2]) < 0.15] = np.nan
    assert abs(found(run).t - 11.24) <= 1.0 / RATE_HZ
    run.p_WE[:, 3] = np.nan
    assert abs(found(run).t - 11.24) <= 1.0 / RATE_HZ
    run.p_WE[:, 4:] = np.nan
    assert knock([run]) is None  # type: ignore[list-item]


def test_a_short_run_tells_nothing() -> None:
    """Shorter than both sides of an instant."""
    run = walked(9)
    assert knock([SimpleNamespace(name="a", t=run.t[:9], p_WE=run.p_WE[:9])]) is None  # type: ignore[list-item]

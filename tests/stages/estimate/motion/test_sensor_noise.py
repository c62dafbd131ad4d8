"""How far a cable sensor is believed: less while its cable moves, and its offset follows its length."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.result import TOUCHES_M, _near_floor
from r2s2r_cli.stages.estimate.motion.rounds import rates
from r2s2r_cli.stages.estimate.motion.sensors import (
    BOW,
    BOW_M,
    DEAD_NOISE_M,
    LATE_S,
    offset_drift,
    sample_variance,
    sample_weights,
)
from tests.support.rig_robots import known


def test_samples_average_out_and_lateness_does_not() -> None:
    """At rest the variance falls with the number of samples; at 0.1 m/s it stays above (0.1 m/s LATE_S)^2."""
    samples, noise = np.array([[1.0], [4.0], [400.0]]), np.array([0.003])
    still = sample_variance(samples, noise, np.zeros((3, 1)))
    np.testing.assert_allclose(still[:, 0], 9e-6 / samples[:, 0])
    moving = sample_variance(samples, noise, np.full((3, 1), 0.1))
    np.testing.assert_allclose(moving - still, (0.1 * LATE_S) ** 2)


def test_silent_and_dead_sensors_weigh_nothing() -> None:
    """No sample, or more noise than DEAD_NOISE_M: 0; else one over the variance."""
    samples = np.array([[0.0, 2.0, 2.0]])
    noise = np.array([0.003, 0.003, 2 * DEAD_NOISE_M])
    weight = sample_weights(samples, noise, np.zeros((1, 3)))
    np.testing.assert_allclose(weight, [[0.0, 2.0 / 9e-6, 0.0]])


def test_offsets_follow_length_whatever_the_frame_rate() -> None:
    """A cable reeled in by 60 mm: the same variance in 10 gaps as in 100, whatever its speed; with time besides."""
    for frames, speed in ((11, 0.06), (101, 0.06), (51, 0.6)):
        t = np.linspace(0.0, 0.06 / speed, frames)
        drift = offset_drift(t, np.full((frames, 1), -speed), 5e-4)
        assert drift.shape == (frames - 1, 1)
        assert drift.sum() == pytest.approx(BOW**2 * BOW_M * 0.06 + 5e-4**2 * t[-1])


def test_rates_are_those_of_the_distances() -> None:
    """Against central differences of the distances of the caps."""
    robot, rng, step = known(), np.random.default_rng(100), 1e-6
    body = Body.of(robot)
    x = np.zeros((4, body.dim))
    x[:, : 3 * body.caps] = np.ravel(robot.rest_caps_m) + 0.02 * rng.standard_normal((4, 3 * body.caps))
    x[:, 3 * body.caps : body.moving] = rng.standard_normal((4, 3 * body.caps))
    p, v = body.positions(x), body.velocities(x)

    def length(dt: float) -> np.ndarray:
        moved = p + dt * v
        return np.linalg.norm(moved[:, body.sensor[:, 1]] - moved[:, body.sensor[:, 0]], axis=-1)

    np.testing.assert_allclose(rates(x, body), (length(step) - length(-step)) / (2 * step), atol=1e-8)


def test_no_contact_is_claimed_high_up_or_while_lost() -> None:
    """Caps at 1 mm touch; at twice TOUCHES_M, or 31 mm uncertain, they do not, however likely contact is."""
    body = Body.of(known())
    x = np.zeros((2, body.dim))
    x[:, 2 + 3 * np.arange(body.caps)] = body.radius + 0.001
    x[0, 2] = body.radius[0] + 2 * TOUCHES_M
    worst = np.full((2, body.caps), 0.005)
    worst[1, 3] = 0.031
    found = _near_floor(x, worst, body, MotionSettings())
    assert not found[0, 0] and not found[1, 3]
    assert found.sum() == 2 * body.caps - 2

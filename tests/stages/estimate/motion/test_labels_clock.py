"""Which blob is which cap, how late the sensors are, what touches: planted, then found."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.motion import touching as touching_module
from r2s2r_cli.stages.estimate.motion.crossing import nearest
from r2s2r_cli.stages.estimate.motion.data import Readings
from r2s2r_cli.stages.estimate.motion.labels import label
from r2s2r_cli.stages.estimate.motion.noise import sensor_variance, sighting_scale
from r2s2r_cli.stages.estimate.motion.sensor_clock import find_clock, hermite
from r2s2r_cli.stages.estimate.motion.sensors import bin_readings
from r2s2r_cli.stages.estimate.motion.touching import touching_probability
from tests.support.camera_motion import Motion, motion, readings
from tests.support.rig_robots import known


@cache
def moving() -> Motion:
    """Four seconds of one robot."""
    return motion(107, 5.0)


def shuffled(p_WE: np.ndarray, rng: np.random.Generator) -> tuple[list[np.ndarray], np.ndarray]:
    """Blobs of each rod in random order, and where each cap went, (cap,)."""
    order = np.array([rng.permutation(2) for _ in range(len(p_WE) // 2)])
    blobs = [p_WE[2 * rod + order[rod]] for rod in range(len(order))]
    return blobs, np.argsort(order, axis=1).ravel()


def test_labels_are_found_by_the_cables_whatever_the_order() -> None:
    """Random relabellings in all phases of a motion, sensors 5 mm off, blobs 1.5 mm off, and distractors."""
    truth, rng = moving(), np.random.default_rng(0)
    for k in rng.integers(0, len(truth.t), 40):
        p = truth.p_WE[k] + 1.5e-3 * rng.standard_normal(truth.p_WE[k].shape)
        blobs, where = shuffled(p, rng)
        blobs[1] = np.vstack([blobs[1], p.mean(axis=0) + rng.uniform(-0.4, 0.4, 3)])
        found = label(blobs, truth.robot, truth.lengths(truth.t[k]) + 5e-3 * rng.standard_normal(9))
        assert found is not None
        assert found.sure
        np.testing.assert_array_equal(found.pick, where)


def test_labels_without_sensors_are_those_of_the_shape_at_rest() -> None:
    """At rest, turned about the vertical, no sensor is needed; a cap that is missing leaves no labelling."""
    truth, rng = moving(), np.random.default_rng(1)
    a = 2.1
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    blobs, where = shuffled(truth.p_WE[0] @ turn.T + [0.3, -0.2, 0.0], rng)
    found = label(blobs, truth.robot)
    assert found is not None
    assert found.sure
    np.testing.assert_array_equal(found.pick, where)
    assert label([blobs[0], blobs[1][:1], blobs[2]], truth.robot) is None


def test_a_missing_cap_is_left_out_where_the_filter_knows_the_rest() -> None:
    """With a prediction 20 mm off, the blobs that are there get their names, the missing one none."""
    truth, rng = moving(), np.random.default_rng(2)
    p = truth.p_WE[-1]
    blobs, where = shuffled(p, rng)
    cap = 3
    blobs[1] = np.delete(blobs[1], where[cap], axis=0)
    predicted = (p + 0.02 * rng.standard_normal(p.shape), np.broadcast_to(0.02**2 * np.eye(3), (6, 3, 3)))
    found = label(blobs, truth.robot, truth.lengths(truth.t[-1]), predicted=predicted, partly=True)
    assert found is not None
    assert found.sure
    assert found.pick[cap] == -1
    others = np.arange(6) != cap
    np.testing.assert_allclose(found.p_WE[others], p[others])


def test_a_foreign_shape_is_not_sure() -> None:
    """Lengths of another shape: whatever labelling is best, it is not called sure."""
    truth = moving()
    wrong = truth.lengths(truth.t[-1]) + np.linspace(-0.1, 0.1, 9)
    found = label([truth.p_WE[-1][2 * rod : 2 * rod + 2] for rod in range(3)], truth.robot, wrong)
    assert found is not None
    assert not found.sure


@pytest.mark.parametrize("offset", [-0.13, 0.21])
def test_planted_delay_is_found(offset: float) -> None:
    """Clock offset plus lag of 30 ms, within 10 ms, from noisy sensors with offsets of 4 mm."""
    truth, rng = moving(), np.random.default_rng(3)
    t = np.arange(0.0, 4.9, 1 / 30)
    length = truth.lengths(t)
    shown, _ = readings(truth, rng, lag_s=0.03, offset_s=offset)
    clock = find_clock(t, length, np.gradient(length, t, axis=0), np.full(length.shape, 5e-4), shown, 0.5)
    assert clock.known
    assert abs(clock.delay_s - offset - 0.03) < 0.01
    assert clock.sd_s < 0.01


def test_delay_of_a_robot_at_rest_is_not_known() -> None:
    """Nothing moves: no delay, and none is claimed."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 4.0, 1 / 30)
    length = np.full((len(t), 9), 0.2)
    shown = Readings(t, length + 3e-3 * rng.standard_normal(length.shape), np.arange(9))
    clock = find_clock(t, length, np.zeros_like(length), np.full(length.shape, 5e-4), shown, 0.5)
    assert not clock.known
    assert clock.delay_s == 0.0


def test_hermite_is_exact_for_cubics() -> None:
    """Values and slopes of a cubic give it back between the frames."""
    t = np.array([0.0, 0.04, 0.1])
    k, when = np.array([0, 1]), np.array([0.013, 0.09])
    np.testing.assert_allclose(hermite(t, t**3 - t, 3 * t**2 - 1, k, when), when**3 - when, atol=1e-15)


def test_samples_go_to_the_frame_nearest_to_when_they_were_true() -> None:
    """Two samples of one frame are averaged, with how late they are; the clock's delay is taken off; NaN is none."""
    t = np.array([0.0, 0.1, 0.2])
    shown = Readings(np.array([0.14, 0.17, 0.24]), np.array([[1.0], [3.0], [np.nan]]), np.array([0]))
    binned = bin_readings(t, shown, 0.05)
    np.testing.assert_array_equal(binned.samples[:, 0], [0, 2, 0])
    assert binned.shown[1, 0] == pytest.approx(2.0)
    assert binned.later[1, 0] == pytest.approx(0.005)


def test_touching_is_the_sum_over_all_histories(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forward and backward messages against the enumeration of all 2^6 histories of one cap."""
    monkeypatch.setattr(touching_module, "ALIKE_S", 1e-9)
    t = np.cumsum(np.array([0.0, 0.03, 0.1, 0.03, 0.3, 0.03]))
    height = np.array([0.0, 0.001, 0.002, 0.01, 0.004, -0.001])
    sd = np.array([5e-4, 1e-3, 2e-3, 5e-2, 1e-3, 5e-4])

    def odds(k: int) -> float:
        """Of one frame alone, from the function itself."""
        p = touching_probability(t[k : k + 1], height[k : k + 1, None], sd[k : k + 1, None])[0, 0]
        return float(np.log(p) - np.log1p(-p))

    own = [odds(k) for k in range(6)]
    stay = 0.5 * (1 + np.exp(-2 * np.diff(t) / touching_module.STEADY_S))
    total = np.zeros((6, 2))
    for history in itertools.product((0, 1), repeat=6):
        weight = np.prod([np.exp(own[k] * history[k]) for k in range(6)])
        for k in range(5):
            weight *= stay[k] if history[k] == history[k + 1] else 1 - stay[k]
        total[np.arange(6), history] += weight
    found = touching_probability(t, height[:, None], sd[:, None])[:, 0]
    np.testing.assert_allclose(found, total[:, 1] / total.sum(axis=1), rtol=1e-9)


def test_nearest_points_of_two_lines() -> None:
    """A cross 3 mm apart: the places are known; parallel lines count as not inside."""
    a, u = np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    s, t, inside = nearest(a, u, np.array([[0.3, -0.2, 0.003]]), np.array([[0.0, 0.8, 0.0]]))
    assert (s[0], t[0], inside[0]) == (pytest.approx(0.3), pytest.approx(0.25), True)
    assert not nearest(a, u, np.array([[0.0, 0.1, 0.0]]), 2 * u)[2][0]


def test_noise_is_what_residuals_show() -> None:
    """Sightings 0.6 and 1.5 times as noisy as stated, a sensor twice: factors on the variances are found."""
    rng = np.random.default_rng(5)
    n = 4000
    axes = np.linalg.qr(rng.standard_normal((n, 3, 3)))[0]
    stated = np.array([3e-4, 3e-4, 1e-3])
    cov = np.einsum("i,nia,nib->nab", stated**2, axes, axes)
    residual = np.einsum("ni,nia->na", rng.standard_normal((n, 3)) * stated * [0.6, 0.6, 1.5], axes)
    found = np.sqrt(sighting_scale(residual, cov, axes, np.zeros((n, 3, 3))))
    np.testing.assert_allclose(found, [0.6, 1.5], rtol=0.05)
    shown = 2e-3 * rng.standard_normal(n)
    factor = sensor_variance(shown, np.full(n, 1e-6), np.zeros(n), np.ones(n, dtype=bool))
    assert factor == pytest.approx(4.0, rel=0.1)


def test_a_robot_of_six_rods_with_strange_blobs_is_labelled() -> None:
    """Three blobs a colour of six rods would be millions of labellings; the likely ones hold the right one."""
    robot = known("sixbar")
    rest = np.array(robot.rest_caps_m)
    rng = np.random.default_rng(100)
    blobs = []
    for rod in range(6):
        strange = rest[2 * rod] + np.array([0.0, 0.0, 0.9]) + 0.05 * rng.standard_normal(3)
        blobs.append(np.stack([rest[2 * rod + 1], strange, rest[2 * rod]]))
    length = np.linalg.norm(np.diff(rest[[cable.caps for cable in robot.cables]], axis=1)[:, 0], axis=-1)
    predicted = (rest, np.tile(1e-4 * np.eye(3), (12, 1, 1)))
    found = label(blobs, robot, length, predicted=predicted, partly=True)
    assert found is not None
    np.testing.assert_allclose(found.p_WE, rest)

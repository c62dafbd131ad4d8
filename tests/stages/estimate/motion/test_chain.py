"""The chain solver against dense linear algebra, and the gradient of every factor against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.kalman import Disturbances, backward, forward, process
from r2s2r_cli.stages.estimate.motion.body import ACROSS, Body
from r2s2r_cli.stages.estimate.motion.chain import Normal, eliminate, marginals, substitute
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.equations import equations, unit_information
from r2s2r_cli.stages.estimate.motion.evidence import Evidence
from tests.support.rig_robots import known

SETTINGS = MotionSettings()


def chain(rng: np.random.Generator, frames: int = 6, dim: int = 4) -> Normal:
    """Random block tridiagonal equations that are positive definite."""
    upper = rng.standard_normal((frames - 1, dim, dim))
    root = rng.standard_normal((frames, dim, dim))
    return Normal(root @ np.swapaxes(root, 1, 2) + 8 * np.eye(dim), upper, rng.standard_normal((frames, dim)))


def dense(normal: Normal) -> np.ndarray:
    """The same as one matrix."""
    n, dim, _ = normal.diagonal.shape
    full = np.zeros((n * dim, n * dim))
    for k in range(n):
        here = slice(k * dim, (k + 1) * dim)
        full[here, here] = normal.diagonal[k]
        if k + 1 < n:
            there = slice((k + 1) * dim, (k + 2) * dim)
            full[here, there], full[there, here] = normal.upper[k], normal.upper[k].T
    return full


def evidence(body: Body, rng: np.random.Generator, frames: int) -> tuple[np.ndarray, Evidence]:
    """States near the robot at rest, and something known of everything."""
    rest = np.array(known().rest_caps_m)
    x = np.zeros((frames, body.dim))
    x[:, : 3 * body.caps] = rest.ravel() + 0.01 * rng.standard_normal((frames, 3 * body.caps))
    x[:, 3 * body.caps :] = 0.01 * rng.standard_normal((frames, body.dim - 3 * body.caps))
    shape = (frames, body.caps)
    root = rng.standard_normal((*shape, 3, 3))
    sensors = (frames, len(body.sensor))
    return x, Evidence(
        t=np.cumsum(rng.uniform(0.02, 0.05, frames)), seen=rest + 0.01 * rng.standard_normal((*shape, 3)),
        information=1e4 * root @ np.swapaxes(root, -1, -2), across=3e-3 * rng.standard_normal((*shape, 3, ACROSS)),
        density=rng.uniform(0.01, 0.1, (frames - 1, body.caps)), kick=np.full(frames - 1, 1e-4),
        shown=0.2 + 0.02 * rng.standard_normal(sensors), later=0.01 * rng.standard_normal(sensors),
        samples=np.ones(sensors), sensor_weight=np.full(sensors, 1e4),
            sensor_drift=rng.uniform(1e-8, 1e-6, (frames - 1, sensors[1])), sighting_bend=None, sensor_bend=2.5,
        touching=rng.uniform(0.0, 1.0, shape),
    )  # fmt: skip


def test_chain_solves_what_one_big_matrix_solves() -> None:
    """Solution, covariances of frames and of neighbouring frames are those of dense linear algebra."""
    normal = chain(np.random.default_rng(0))
    n, dim, _ = normal.diagonal.shape
    full = np.linalg.inv(dense(normal))
    done = eliminate(normal)
    marginal = marginals(done)
    np.testing.assert_allclose(substitute(done).ravel(), -full @ normal.gradient.ravel(), atol=1e-12)
    for k in range(n):
        here = slice(k * dim, (k + 1) * dim)
        np.testing.assert_allclose(marginal.cov[k], full[here, here], atol=1e-12)
        if k + 1 < n:
            np.testing.assert_allclose(marginal.cross[k], full[here, (k + 1) * dim : (k + 2) * dim], atol=1e-12)


def test_an_undetermined_state_is_refused() -> None:
    """A state that nothing observes stops the elimination."""
    normal = chain(np.random.default_rng(1))
    normal.diagonal[0, 0], normal.diagonal[0, :, 0], normal.upper[0, 0] = 0.0, 0.0, 0.0
    with pytest.raises(NumericalError, match="not determined"):
        eliminate(normal)


def test_chain_is_the_smoother_of_one_cap() -> None:
    """Positions of one axis: elimination and substitution give the Rauch-Tung-Striebel smoother of `kalman.py`."""
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.02, 0.06, 12))
    y, var, q = rng.standard_normal(12) * 0.01, 1e-6, 0.02
    free = Disturbances(np.zeros(11), np.zeros((11, 1)))
    fit = forward(t, y[:, None], np.full((12, 1), var), np.array([[q]]), free)
    expected = backward(t, y[:, None], np.full((12, 1), var), free, fit)
    weight = unit_information(np.diff(t)) / q
    diagonal, upper, gradient = np.zeros((12, 2, 2)), np.zeros((11, 2, 2)), np.zeros((12, 2))
    diagonal[:, 0, 0] = 1 / var
    diagonal[0] += np.eye(2) / 100.0
    gradient[:, 0] = -y / var
    gradient[0, 0] -= y[0] / 100.0
    for k, dt in enumerate(np.diff(t)):
        step = np.array([[1.0, dt], [0.0, 1.0]])
        diagonal[k] += step.T @ weight[k] @ step
        diagonal[k + 1] += weight[k]
        upper[k] = -step.T @ weight[k]
    done = eliminate(Normal(diagonal, upper, gradient))
    np.testing.assert_allclose(substitute(done), expected.mean[:, 0], atol=1e-8)
    np.testing.assert_allclose(marginals(done).cov, expected.cov[:, 0], rtol=1e-5, atol=1e-12)


def test_information_of_a_gap_is_the_inverse_of_its_noise() -> None:
    """Closed form against the inverse."""
    gaps = np.array([0.01, 0.033, 0.5])
    expected = [np.linalg.inv(process(float(dt))) for dt in gaps]
    np.testing.assert_allclose(unit_information(gaps), expected, rtol=1e-9)


def test_gradient_is_the_slope_of_the_cost() -> None:
    """Central differences: motion, sightings with shared errors, rods, sensors, floor, crossing rods."""
    body = Body.of(known(), sharing=True)
    rng = np.random.default_rng(3)
    x, known_of = evidence(body, rng, 4)
    x[:, body.p(0)[2]] = body.radius[0] - 0.004  # one cap below the floor
    x[:, body.p(2)] = x[:, body.p(0)] + 0.4 * (x[:, body.p(1)] - x[:, body.p(0)]) + [0.0, 0.0, 1e-3]
    known_of = replace(known_of, touching=known_of.touching * (np.arange(body.caps) > 0))

    def at(y: np.ndarray) -> float:
        return equations(y, known_of, body, SETTINGS)[0]

    gradient = equations(x, known_of, body, SETTINGS)[1].gradient.copy()
    # The prior of the first positions moves along with them: it has no slope by design.
    for _ in range(12):
        d = rng.standard_normal(x.shape)
        h = 1e-7
        slope = (at(x + h * d) - at(x - h * d)) / (2 * h)
        assert slope == pytest.approx(float(np.sum(gradient * d)), rel=2e-4)

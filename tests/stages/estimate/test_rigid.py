"""Rods: exact length, least movement, poses without roll."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.rigid import (
    angular_velocities,
    axes,
    from_matrix,
    is_rigid,
    make_rigid,
    multiply,
    orientations,
    rotate,
    smallest_rotation,
)
from r2s2r_cli.stages.init.attachment import rod_frames
from tests.stages.estimate.planted import JUDGING_SEEDS, LENGTH, planted

Z = np.array([0.0, 0.0, 1.0])


def random_rods(seed: int, frames: int = 40, rods: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Caps near the rod length with full covariances, and velocities with theirs."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(frames, rods, 3))
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    middle = rng.normal(size=(frames, rods, 3))
    p = np.stack([middle - 0.5 * LENGTH * u, middle + 0.5 * LENGTH * u], axis=2).reshape(frames, 2 * rods, 3)
    p += 0.003 * rng.normal(size=p.shape)
    root = 0.002 * rng.normal(size=(frames, 2 * rods, 3, 3))
    cov = root @ np.swapaxes(root, -1, -2) + 1e-7 * np.eye(3)
    return p, cov, 0.1 * rng.normal(size=p.shape), 100 * cov


def walk(seed: int, frames: int = 300) -> np.ndarray:
    """Axes of three rods that wander over the whole sphere, shape (frame, 3, 3)."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(0, 0.15, (frames, 3, 3)), axis=0) + rng.normal(size=(3, 3))
    return u / np.linalg.norm(u, axis=-1, keepdims=True)


@pytest.mark.parametrize("seed", range(3))
def test_rods_get_their_length_and_keep_it(seed: int) -> None:
    """The caps are a rod length apart to rounding, and their velocities do not stretch the rod."""
    given = random_rods(seed)
    rods = make_rigid(*given, np.full(3, LENGTH), np.ones(3, dtype=bool))
    bar = rods.p_WE[:, 1::2] - rods.p_WE[:, 0::2]
    assert np.linalg.norm(bar, axis=-1) == pytest.approx(LENGTH, abs=1e-12)
    stretch = np.sum(axes(rods.p_WE) * (rods.v_WE[:, 1::2] - rods.v_WE[:, 0::2]), axis=-1)
    assert stretch == pytest.approx(0.0, abs=1e-12)
    assert rods.correction == pytest.approx(np.linalg.norm(rods.p_WE - given[0], axis=-1))


def test_equal_covariances_move_both_caps_alike_along_the_rod() -> None:
    """Closed form for equal round covariances: the middle stays, each cap moves by half of the error."""
    p = np.array([[[0.0, 0.0, 0.1], [0.0, 0.331, 0.1]]])
    cov = np.broadcast_to(4e-6 * np.eye(3), (1, 2, 3, 3))
    rods = make_rigid(p, cov, np.zeros_like(p), cov, np.array([LENGTH]), np.array([True]))
    assert rods.p_WE == pytest.approx(np.array([[[0.0, 0.003, 0.1], [0.0, 0.328, 0.1]]]), abs=1e-12)
    assert rods.cov_p[0, 0] == pytest.approx(np.diag([4e-6, 2e-6, 4e-6]), abs=1e-15)


def test_a_well_known_cap_stays_where_it_is() -> None:
    """A cap with a hundred times smaller variance moves a hundred times less."""
    p = np.array([[[0.0, 0.0, 0.1], [0.331, 0.0, 0.1]]])
    cov = np.stack([1e-8 * np.eye(3), 1e-6 * np.eye(3)])[None]
    rods = make_rigid(p, cov, np.zeros_like(p), cov, np.array([LENGTH]), np.array([True]))
    assert rods.correction[0, 0] * 100 == pytest.approx(rods.correction[0, 1], rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_no_rod_of_that_length_is_nearer(seed: int) -> None:
    """Least squares: the pull of each cap on its observation, C^-1 (p - p0), points along the rod, equal and opposite.

    Independent variances of 1 to 4 mm per axis, as estimate has them, and caps 3 mm from where they should be.
    """
    p, _, v, _ = random_rods(seed)
    sd = np.random.default_rng(seed).uniform(0.001, 0.004, p.shape)
    cov = sd[..., None] ** 2 * np.eye(3)
    rods = make_rigid(p, cov, v, cov, np.full(3, LENGTH), np.ones(3, dtype=bool))
    pull = (rods.p_WE - p) / sd**2
    u = axes(rods.p_WE)
    strength = np.sum(pull[:, 0::2] * u, axis=-1, keepdims=True)
    unit = np.abs(strength)
    assert pull[:, 0::2] / unit == pytest.approx(strength / unit * u, abs=1e-6)
    assert pull[:, 1::2] / unit == pytest.approx(-strength / unit * u, abs=1e-6)


def test_a_rigid_source_is_recognised_and_its_covariance_kept() -> None:
    """Noise whose rods were made rigid by the source is told from free noise, and the length then narrows nothing."""
    sample = planted(JUDGING_SEEDS[0])
    assert not np.any(is_rigid(sample.observed, sample.noise_sd))
    n, cov = len(sample.t), np.broadcast_to(1e-6 * np.eye(3), (*sample.observed.shape, 3))
    fitted = make_rigid(
        sample.observed, cov, np.zeros_like(sample.observed), cov, np.full(3, LENGTH), np.ones(3, dtype=bool)
    )
    assert np.all(is_rigid(fitted.p_WE, sample.noise_sd))
    kept = make_rigid(fitted.p_WE, cov, np.zeros((n, 6, 3)), cov, np.full(3, LENGTH), np.zeros(3, dtype=bool))
    assert np.array_equal(kept.cov_p, cov)


def test_coinciding_caps_are_refused() -> None:
    """A rod without direction is a numerical error that names rod and frame."""
    p, cov, v, cov_v = random_rods(0)
    p[7, 3] = p[7, 2]
    with pytest.raises(NumericalError, match="rod 1") as caught:
        make_rigid(p, cov, v, cov_v, np.full(3, LENGTH), np.ones(3, dtype=bool))
    assert "7" in caught.value.where


@pytest.mark.parametrize("seed", range(3))
def test_orientations_point_along_the_rods(seed: int) -> None:
    """Quaternions have unit length and turn z onto the axis, over hundreds of frames."""
    u = walk(seed)
    q = orientations(u, rod_frames(np.stack([-u[0], u[0]], axis=1).reshape(-1, 3)))
    assert np.linalg.norm(q, axis=-1) == pytest.approx(1.0, abs=1e-12)
    assert rotate(q, np.broadcast_to(Z, u.shape)) == pytest.approx(u, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_orientations_are_continuous_and_have_no_roll(seed: int) -> None:
    """From frame to frame the quaternion keeps its sign, and the rotation between has no part along the rod."""
    u = walk(seed)
    q = orientations(u, rod_frames(np.stack([-u[0], u[0]], axis=1).reshape(-1, 3)))
    assert np.all(np.sum(q[1:] * q[:-1], axis=-1) > 0)
    inverse = q[:-1] * np.array([-1.0, -1.0, -1.0, 1.0])
    between = multiply(q[1:], inverse)
    assert np.sum(between[..., :3] * u[:-1], axis=-1) == pytest.approx(0.0, abs=1e-12)
    assert np.sum(between[..., :3] * u[1:], axis=-1) == pytest.approx(0.0, abs=1e-12)


def test_the_first_frame_follows_the_convention_of_init() -> None:
    """R of the first frame is the one that attachment sites are given in."""
    p = planted(0).p_WE
    u = axes(p)
    R = rod_frames(p[0])
    q = orientations(u, R)
    for i in range(3):
        turned = np.stack([rotate(q[0, i], e) for e in np.eye(3)], axis=-1)
        assert turned == pytest.approx(R[i], abs=1e-12)


def test_matrix_to_quaternion_holds_for_every_branch() -> None:
    """Every rotation, half turns included, comes back from its quaternion."""
    rng = np.random.default_rng(1)
    for q in [*rng.normal(size=(50, 4)), *np.eye(4)]:
        q = q / np.linalg.norm(q)
        m = np.stack([rotate(q, e) for e in np.eye(3)], axis=-1)
        found = from_matrix(m)
        assert abs(found @ q) == pytest.approx(1.0, abs=1e-12)


def test_a_reversed_rod_is_turned_about_the_given_axis() -> None:
    """Opposite directions have no smallest rotation; the fallback makes it a half turn that still fits."""
    q = smallest_rotation(Z, -Z, fallback=np.array([1.0, 0.0, 0.0]))
    assert rotate(q, Z) == pytest.approx(-Z, abs=1e-12)


def test_angular_velocity_is_that_of_the_turning_rod() -> None:
    """A rod that turns about a known axis across it shows that angular velocity, and none along itself."""
    t = np.linspace(0, 1, 5)
    u = np.stack([np.cos(2 * t), np.sin(2 * t), np.zeros(5)], axis=-1)[:, None]
    v = 2 * np.stack([-np.sin(2 * t), np.cos(2 * t), np.zeros(5)], axis=-1)
    caps = np.stack([-0.5 * LENGTH * v, 0.5 * LENGTH * v], axis=1)
    w = angular_velocities(u, caps, np.array([LENGTH]))
    assert w[:, 0] == pytest.approx(np.broadcast_to([0.0, 0.0, 2.0], (5, 3)), abs=1e-12)
    assert np.sum(w * u, axis=-1) == pytest.approx(0.0, abs=1e-12)

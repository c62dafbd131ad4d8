"""Caps that stand, against the ground: slopes and heights that were put in, and a cap that only hangs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.heights import Heights, heights
from tests.support.robots import subject

NOISE_M = 0.002
FRAMES = 12


def stood(height: np.ndarray, slope: tuple[float, float] = (0.0, 0.0), intervals: int = 12) -> Heights:
    """A robot put down on four of its caps, others in turn, at a place and heading of its own in every interval.
    height: of every cap over where it should stand, (cap,) [m]; slope: of the ground along x and y."""
    robot, rng = subject("threebar").robot, np.random.default_rng(4)
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    p = np.empty((intervals * FRAMES, 6, 3))
    for i in range(intervals):
        rows = slice(i * FRAMES, (i + 1) * FRAMES)
        p[rows, :, :2] = 0.15 * rng.standard_normal((6, 2))
        p[rows, :, 2] = radius + height + p[rows, :, :2] @ np.array(slope)
        for up in rng.permutation(6)[:2]:
            p[rows, up, 2] = 0.2
    seen = p + NOISE_M * rng.standard_normal(p.shape)
    caps = SimpleNamespace(p_WE=p, v_WE=np.zeros_like(p))
    series = SimpleNamespace(run=SimpleNamespace(caps=caps), noise=np.full(6, NOISE_M), p_WE=seen,
                             interval=np.arange(len(p)) // FRAMES + 1)  # fmt: skip
    found = heights([series], robot)  # type: ignore[list-item]
    assert found is not None
    return found


def test_a_worn_cap_and_a_slope_are_found_beside_each_other() -> None:
    """Each within three of its errors: a cap 2 mm lower, less its share of the mean, on a ground of one degree."""
    worn = np.array([0.0, 0.0, -0.002, 0.0, 0.0, 0.0])
    found = stood(worn, (0.0, np.deg2rad(1.0)))
    x, y = found.slope
    assert abs(x.value - np.deg2rad(1.0)) < 3 * x.sd + 1e-3 and abs(y.value) < 3 * y.sd + 1e-3
    for one, true in zip(found.cap, worn - worn.mean(), strict=True):
        assert abs(one.value - true) < 3 * one.sd + 2e-4


@pytest.mark.parametrize("by", [0.006, 0.009])
def test_a_cap_that_hangs_does_not_lift_the_others(by: float) -> None:
    """It says nothing of itself, and the others stand as if it were not there."""
    hanging = np.array([0.0, 0.0, 0.0, by, 0.0, 0.0])
    found = stood(hanging)
    assert np.isnan(found.cap[3].value)
    for k in (0, 1, 2, 4, 5):
        assert abs(found.cap[k].value) < 3 * found.cap[k].sd + 2e-4

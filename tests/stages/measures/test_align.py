"""Planar alignment: recovered moves, the least squares, the degenerate case."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.measures.align import PlanarMove, planar

CAPS = np.random.default_rng(3).normal(size=(6, 3))


@pytest.mark.parametrize("yaw", [-3.1, -0.4, 0.0, 1.9])
def test_a_planted_move_is_recovered(yaw: float) -> None:
    """Turn about the vertical and shift over the ground, whatever the heights."""
    truth = PlanarMove(yaw, np.array([0.3, -1.2, 0.0]))
    onto = truth.move(CAPS) + np.array([0.0, 0.0, 0.5])
    found = planar(CAPS, onto)
    assert found.yaw == pytest.approx(yaw, abs=1e-12)
    assert found.translation == pytest.approx(truth.translation, abs=1e-12)


def test_no_other_move_is_nearer() -> None:
    """Of noisy caps: every small change of x, y or yaw enlarges the sum of squares."""
    onto = PlanarMove(0.8, np.array([0.1, 0.2, 0.0])).move(CAPS) + np.random.default_rng(4).normal(size=(6, 3))
    best = planar(CAPS, onto)
    least = np.sum((best.move(CAPS) - onto) ** 2)
    for yaw, x, y in [(1e-3, 0, 0), (-1e-3, 0, 0), (0, 1e-3, 0), (0, -1e-3, 0), (0, 0, 1e-3), (0, 0, -1e-3)]:
        other = PlanarMove(best.yaw + yaw, best.translation + np.array([x, y, 0.0]))
        assert np.sum((other.move(CAPS) - onto) ** 2) > least


def test_heights_stay_and_displacements_only_turn() -> None:
    """A quarter turn: (1, 0, 2) becomes (0, 1, 2) as a displacement, and moves on by the shift as a point."""
    move = PlanarMove(np.pi / 2, np.array([5.0, 6.0, 0.0]))
    assert move.turn(np.array([1.0, 0.0, 2.0])) == pytest.approx([0.0, 1.0, 2.0])
    assert move.move(np.array([1.0, 0.0, 2.0])) == pytest.approx([5.0, 7.0, 2.0])


def test_caps_above_each_other_have_no_yaw() -> None:
    """All on one vertical: shifted, not turned."""
    pole = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.4]])
    found = planar(pole, pole + np.array([1.0, 2.0, 0.0]))
    assert found.yaw == 0.0
    assert found.translation == pytest.approx([1.0, 2.0, 0.0])

"""Figures of a run in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.simulate.measures import com_path, heading_change, penetration, slack_share
from tests.support import builders
from tests.support.motion import YAW_RAD_PER_S, motion


def test_the_way_over_the_ground_is_an_arc_length() -> None:
    """A circle of 0.3 m seen in 400 frames has its circumference, whatever the height does."""
    angle = np.linspace(0, 2 * np.pi, 401)
    com = np.stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), np.sin(9 * angle)], axis=-1)
    assert com_path(com) == pytest.approx(0.6 * np.pi, rel=1e-4)


def test_the_heading_follows_a_turn_of_the_robot() -> None:
    """A turn about the vertical at a constant rate is found, beyond half a turn as well."""
    m = motion(builders.robot(), 300)
    assert heading_change(m.p_WE) == pytest.approx(YAW_RAD_PER_S * m.t[-1])
    assert YAW_RAD_PER_S * m.t[-1] > np.pi


def test_rolling_does_not_change_the_heading() -> None:
    """A turn about the mean rod axis leaves the heading where it is."""
    rest = np.array(builders.robot().rest_caps_m)
    axis = rest[1::2] - rest[0::2]
    u = (axis / np.linalg.norm(axis, axis=-1, keepdims=True)).mean(axis=0)
    u /= np.linalg.norm(u)
    angle = np.linspace(0, 2, 50)[:, None, None]
    along = (rest @ u)[:, None] * u
    rolled = along + np.cos(angle) * (rest - along) + np.sin(angle) * np.cross(u, rest)
    assert heading_change(rolled) == pytest.approx(0, abs=1e-12)


def test_upright_rods_have_no_heading() -> None:
    """Axes that stand upright, or cancel, have no direction in the ground plane."""
    upright = np.array([[0, 0, 0], [0, 0, 1.0], [1, 0, 0], [1, 0, 1.0]])
    cancelling = np.array([[0, 0, 0], [1.0, 0, 0], [1, 1, 0], [0, 1.0, 0]])
    for caps in (upright, cancelling):
        assert heading_change(np.stack([caps, caps])) is None


def test_penetration_is_the_deepest_cap() -> None:
    """Below z = 0 by its own radius; 0 where all are above."""
    p = np.array([[[0, 0, 0.017], [0, 0, 0.030]], [[0, 0, 0.020], [0, 0, 0.0195]]])
    assert penetration(p, np.array([0.0175, 0.02])) == pytest.approx(0.0005)
    assert penetration(p + 0.1, np.array([0.0175, 0.02])) == 0


def test_slack_is_a_share_of_the_frames() -> None:
    """A cable without tension in one of four frames is slack for a quarter of them."""
    tension = np.array([[0.0, 1.0], [2.0, 1.0], [3.0, 1.0], [1.0, 1.0]])
    assert slack_share(tension) == (0.25, 0.0)

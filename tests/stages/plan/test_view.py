"""How far a robot may go in the picture: against pictures of robots that went there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.plan.view import reach_seen, view_reach
from tests.support.robots import subject

ROBOT = subject("threebar").robot
FACTS: dict[str, Any] = {"width": 640, "height": 480, "fx": 600.0, "fy": 610.0, "cx": 320.0, "cy": 240.0}


def looking(position: tuple[float, float, float], tilt: float = 0.0) -> np.ndarray:
    """Pose of a camera that looks down, tilted about its x axis [rad]."""
    c, s = np.cos(tilt), np.sin(tilt)
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    X_WC[:3, 3] = position
    return X_WC


def in_picture(X_WC: np.ndarray, p_WE: np.ndarray) -> bool:
    """Whether all points are in the picture."""
    p_C = (p_WE - X_WC[:3, 3]) @ X_WC[:3, :3]
    u, v = FACTS["fx"] * p_C[:, 0] / p_C[:, 2] + FACTS["cx"], FACTS["fy"] * p_C[:, 1] / p_C[:, 2] + FACTS["cy"]
    return bool(((u > 0) & (u < 640) & (v > 0) & (v < 480)).all())


@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_a_robot_within_reach_is_seen_and_one_well_beyond_is_not_always(tilt: float) -> None:
    """Moved and turned any way within it all caps are in the picture; a quarter of a metre farther some way is not."""
    X_WC = looking((0.3, -0.2, 2.4), tilt)
    reach = view_reach(X_WC, FACTS, ROBOT)
    assert reach is not None
    assert 0.4 < reach < 0.8
    rng = np.random.default_rng(1)
    p = np.array(ROBOT.rest_caps_m)
    p[:, :2] -= p[:, :2].mean(axis=0)
    corners = np.array([[u, v] for u in (0, 640) for v in (0, 480)], dtype=float)
    rays = np.column_stack([(corners - [320, 240]) / [FACTS["fx"], FACTS["fy"]], np.ones(4)]) @ X_WC[:3, :3].T
    top = p[:, 2].max()
    middle = (X_WC[:2, 3] + rays[:, :2] * ((top - X_WC[2, 3]) / rays[:, 2])[:, None]).mean(axis=0)

    def placed(far: float) -> bool:
        a, b = rng.uniform(-np.pi, np.pi, 2)
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        xy = p[:, :2] @ turn.T + middle + far * np.array([np.cos(b), np.sin(b)])
        return in_picture(X_WC, np.column_stack([xy, p[:, 2]]))

    assert all(placed(reach) for _ in range(200))
    assert not all(placed(reach + 0.25) for _ in range(200))


def test_a_camera_that_sees_the_horizon_sets_no_limit_and_a_low_one_leaves_no_room() -> None:
    """None where a corner does not see the floor; 0 where the robot itself does not fit."""
    assert view_reach(looking((0, 0, 2.0), tilt=1.3), FACTS, ROBOT) is None
    assert view_reach(looking((0, 0, 0.6)), FACTS, ROBOT) == 0.0


def test_the_least_of_all_runs_counts() -> None:
    """Runs without a camera set no limit."""
    runs = {f"runs/{name}/camera": Group({"X_WC": looking((0, 0, z))}, FACTS) for name, z in (("a", 2.4), ("b", 1.8))}
    data = ArtifactData("estimate", {**runs, "runs/c": Group()})
    assert reach_seen(data, ROBOT) == view_reach(looking((0, 0, 1.8)), FACTS, ROBOT)
    assert reach_seen(ArtifactData("estimate", {"runs/c": Group()}), ROBOT) is None

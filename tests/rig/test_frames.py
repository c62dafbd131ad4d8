"""Frames of the rods and quaternions at MuJoCo's border, against the definition and against the engine's side."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.model import rest_pose
from r2s2r_cli.rig.model.frames import quaternion, rest_frames, rotation, site_spans, wxyz, xyzw
from r2s2r_cli.stages.init.attachment import rod_frames, site_points
from schemas.robot import Robot
from tests.support.rig_robots import known, values


def turn(generator: np.random.Generator) -> np.ndarray:
    """A random rotation matrix, by QR."""
    q, r = np.linalg.qr(generator.normal(size=(3, 3)))
    q = q * np.sign(np.diagonal(r))
    return q * np.linalg.det(q)


@pytest.mark.parametrize("name", ["threebar", "threebar-330", "sixbar"])
def test_rest_frames_are_those_that_init_defined(name: str) -> None:
    """The rig's own reading of the definition gives the frames in which `init` wrote the sites."""
    robot = known(name)
    np.testing.assert_allclose(rest_frames(robot), rod_frames(np.array(robot.rest_caps_m)), atol=1e-12)


def test_an_upright_rod_has_its_x_axis_along_the_world_s() -> None:
    """Where no direction across the rod points upwards, x is most along the world's x."""
    robot = values()
    robot["rest_caps_m"][0:2] = [[0.3, 0.2, 0.1], [0.3, 0.2, 0.425]]
    frame = rest_frames(Robot.model_validate(robot))[0]
    np.testing.assert_allclose(frame, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("name", ["threebar", "sixbar"])
def test_sites_lie_where_the_attachment_says(name: str) -> None:
    """Distances between the sites at rest are those of `init`'s own site points."""
    robot = known(name)
    p_WE, pose = np.array(robot.rest_caps_m), rest_pose(robot)
    sites = np.array([cable.sites_m for cable in robot.cables])
    points = site_points(p_WE, [cable.caps for cable in robot.cables], sites, rod_frames(p_WE))
    expected = np.linalg.norm(points[:, 1] - points[:, 0], axis=-1)
    np.testing.assert_allclose(site_spans(robot, pose.p_WR, rotation(pose.q_WR)), expected, atol=1e-12)
    np.testing.assert_allclose(pose.rest, expected[list(robot.actuated)], atol=1e-12)


def test_quaternions_and_matrices_are_inverse_to_each_other() -> None:
    """Matrix -> xyzw -> matrix, for random turns and for half turns about every axis, where w is 0."""
    generator = np.random.default_rng(0)
    half_turns = [2 * np.outer(a, a) - np.eye(3) for a in (*np.eye(3), np.array([0.6, 0.0, 0.8]))]
    for R in [*(turn(generator) for _ in range(50)), *half_turns]:
        q = quaternion(R)
        assert q[3] >= 0
        np.testing.assert_allclose(rotation(q), R, atol=1e-14)


def test_a_turn_about_x_is_written_as_mujoco_writes_it() -> None:
    """A quarter turn about x: xyzw (s, 0, 0, s) here, wxyz (s, s, 0, 0) there, and back."""
    s = np.sqrt(0.5)
    q = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    np.testing.assert_allclose(q, [s, 0, 0, s], atol=1e-15)
    np.testing.assert_allclose(wxyz(q), [s, s, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(xyzw(wxyz(np.arange(8.0).reshape(2, 4))), np.arange(8.0).reshape(2, 4))


def test_a_rod_without_length_is_refused() -> None:
    """Two equal caps: the message names them."""
    caps = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0, 1]]
    with pytest.raises(InputError, match="two caps of rod 1 are one point") as caught:
        rest_frames(known().model_copy(update={"rest_caps_m": caps}))
    assert caught.value.where == "caps 2 and 3"

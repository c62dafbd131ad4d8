"""Sensors that jump or fall silent while the camera sees every cap: the caps keep their names and places."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.motion.forward import Forward
from r2s2r_cli.stages.estimate.motion.labels import label
from schemas.robot import Robot
from tests.support.rig_robots import known

FRAME_S = 1 / 30
LATE_S = 0.005
COV = 1e-6 * np.eye(3)
JUMP_AT, END, IN_SIGHT_M = 30, 75, 0.06
HIDDEN = 2


def at_rest() -> tuple[Robot, np.ndarray, np.ndarray, list[np.ndarray]]:
    """The robot, its caps (cap, 3), what its sensors show (sensor,), and the blobs of each rod."""
    robot = known()
    p = np.array(robot.rest_caps_m, dtype=float)
    ends = np.array([robot.cables[sensor.cable].caps for sensor in robot.sensors])
    return robot, p, np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=-1), list(p.reshape(-1, 2, 3))


def tracked(jump: np.ndarray, *, silent: bool = False, hidden: range = range(0)) -> tuple[np.ndarray, np.ndarray]:
    """Largest error of a cap [m] and whether lost, of every frame: the robot rests, its sensors jump, and fall silent
    one frame later; the eye finds caps near their predictions, all but HIDDEN in the frames `hidden`."""
    robot, p, length, blobs = at_rest()
    forward, off, lost = Forward(robot), [], []
    forward.start(0.0, p)
    for k in range(1, END):
        t = k * FRAME_S
        if not (silent and k > JUMP_AT):
            forward.sense(t - LATE_S, length + (jump if k >= JUMP_AT else 0.0))
        forward.predict(t)
        lost.append(forward.lost)
        there = np.arange(len(p)) != (HIDDEN if k in hidden else -1)
        if forward.lost:
            seen = [pair[here] for pair, here in zip(blobs, there.reshape(-1, 2), strict=True)]
            forward.reacquire(t, seen, COV)
        near = there & (np.linalg.norm(forward.p_WE - p, axis=-1) < IN_SIGHT_M)
        forward.update(t, np.where(near[:, None], p, np.nan), np.tile(COV, (len(p), 1, 1)))
        off.append(np.linalg.norm(forward.p_WE - p, axis=-1)[there].max())
    return np.array(off), np.array(lost)


def jumps(*at: tuple[int, float]) -> np.ndarray:
    """Of each sensor [m]."""
    out = np.zeros(len(known().sensors))
    for sensor, by in at:
        out[sensor] = by
    return out


@pytest.mark.parametrize("silent", [False, True])
@pytest.mark.parametrize("by", [0.045, 0.1])
def test_sensors_that_jump_or_stop_move_no_cap_in_sight(by: float, silent: bool) -> None:
    """Two sensors jump apart: nothing is lost, and every cap stays within millimetres."""
    off, lost = tracked(jumps((0, by), (1, -by)), silent=silent)
    assert not np.any(lost)
    assert np.max(off) < 4e-3


def test_sensors_that_jump_move_no_cap_in_sight_while_another_is_hidden() -> None:
    """The hidden cap may be lost; those in sight stay where they are."""
    off, _ = tracked(jumps((0, 0.1), (1, -0.1)), hidden=range(JUMP_AT - 5, JUMP_AT + 25))
    assert np.max(off) < 5e-3


def test_lengths_shown_long_ago_are_forgotten() -> None:
    """Sensors jump and fall silent; a cap that hides later for a moment is not lost because of what they showed."""
    robot, *_ = at_rest()
    one, other, *_ = (k for k, sensor in enumerate(robot.sensors) if HIDDEN in robot.cables[sensor.cable].caps)
    off, lost = tracked(jumps((one, 0.1), (other, -0.1)), silent=True, hidden=range(JUMP_AT + 10, JUMP_AT + 20))
    assert not np.any(lost)
    assert np.max(off) < 4e-3


def test_a_blob_at_a_cap_in_sight_is_never_left_out() -> None:
    """All pairs of sensors 50 mm off, either way: all caps keep their names."""
    robot, p, length, blobs = at_rest()
    cables = [sensor.cable for sensor in robot.sensors]
    predicted = (p, np.tile(1e-6 * np.eye(3), (len(p), 1, 1)))
    for pair in itertools.combinations(range(len(length)), 2):
        for signs in itertools.product((-0.05, 0.05), repeat=2):
            wrong = np.full(len(robot.cables), np.nan)
            wrong[cables] = length + jumps(*zip(pair, signs, strict=True))
            found = label(blobs, robot, wrong, predicted=predicted, partly=True, kept=np.ones(len(p), dtype=bool))
            assert found is not None
            np.testing.assert_array_equal(found.pick, np.arange(len(p)) % 2)


def test_names_exchanged_out_of_sight_are_still_noticed() -> None:
    """A rod comes back into sight with its caps under each other's names: the sensors have not agreed with that, are
    heard, and the names are put right."""
    robot, p, length, blobs = at_rest()
    swapped = p[[1, 0, 2, 3, 4, 5]]
    covs = np.tile(COV, (len(p), 1, 1))
    forward = Forward(robot)
    forward.start(0.0, p)
    for k in range(1, 60):
        t = k * FRAME_S
        forward.sense(t - LATE_S, length)
        forward.predict(t)
        if k == 45:
            forward.states.x[:6] = swapped[:2].ravel()
        if k > 45 and forward.lost and forward.reacquire(t, blobs, COV):
            break
        rod = p[:2] if k < 30 else swapped[:2] if k >= 45 else np.full((2, 3), np.nan)
        forward.update(t, np.concatenate([rod, p[2:]]), covs)
    assert k < 55
    np.testing.assert_allclose(forward.p_WE, p, atol=5e-3)

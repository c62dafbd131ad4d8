"""The pass over the images finds a robot again that is elsewhere than it was taken to be; the eye is a planted one."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings
from r2s2r_cli.stages.estimate.motion.doubt import AGAIN_S, BLIND_S, MISSED_S, REFUSED, Doubt
from r2s2r_cli.stages.estimate.motion.forward import Forward
from r2s2r_cli.stages.estimate.motion.labels import label
from r2s2r_cli.stages.estimate.sweep import Sweep, Swept
from tests.support.planted_eye import X_WC, EmptyFrames, PlantedEye
from tests.support.rig_robots import known

FRAME_S = 1 / 30
RIGHT_M = 0.005
ELSEWHERE = np.array([0.45, -0.4, 0.0])


def at_rest() -> np.ndarray:
    """Caps of the robot at rest [m], (cap, 3)."""
    return np.array(known().rest_caps_m, dtype=float)


def rolled(p_WE: np.ndarray, angle_rad: float) -> np.ndarray:
    """The same shape, rolled about the y axis and set down on the floor beside where it was."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    middle = p_WE.mean(axis=0)
    out = (p_WE - middle) @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]).T + middle
    out[:, 2] += p_WE[:, 2].min() - out[:, 2].min()
    return np.asarray(out + np.array([0.15, 0.0, 0.0]))


def swept(p_WE: np.ndarray, gone: np.ndarray, *, sensors: bool = True) -> Swept:
    """The pass over planted caps (frame, cap, 3); sensors show what is, but for an offset each and noise."""
    robot, rng = known(), np.random.default_rng(1)
    t = FRAME_S * np.arange(len(p_WE))
    cable = np.array([sensor.cable for sensor in robot.sensors])
    ends = np.array([robot.cables[c].caps for c in cable])
    length = np.linalg.norm(p_WE[:, ends[:, 1]] - p_WE[:, ends[:, 0]], axis=-1)
    shown = length + 0.003 * rng.standard_normal(len(cable)) + 0.003 * rng.standard_normal(length.shape)
    readings = Readings(t - 1e-3, shown, cable) if sensors else None
    eye = cast("Any", PlantedEye(p_WE, gone))
    return Sweep("run", EmptyFrames(t), eye, X_WC, readings, robot, MotionSettings(), lambda more: None).run()


def off(found: Swept, p_WE: np.ndarray) -> np.ndarray:
    """Distance of the sightings from what was planted [m], (frame, cap)."""
    return np.linalg.norm(found.sighted.p_WE - p_WE, axis=-1)


@pytest.mark.parametrize("at", [1, 12])
def test_a_robot_that_is_suddenly_elsewhere_is_found_and_no_frame_is_wrong(at: int) -> None:
    """0.6 m away from one frame to the next, once after the very first: before the search is due nothing is seen, but
    those frames are gone through again, so that every sighting of the run is there and right."""
    p_WE = np.tile(at_rest(), (28, 1, 1))
    p_WE[at:] += ELSEWHERE
    found = swept(p_WE, np.zeros(p_WE.shape[:2], dtype=bool))
    assert np.max(off(found, p_WE)) < RIGHT_M  # no NaN: all are seen
    again = np.flatnonzero(found.searched)
    assert len(again) == 1
    assert again[0] - at <= MISSED_S / FRAME_S + 2
    causal = np.linalg.norm(found.known - p_WE, axis=-1)
    assert np.max(causal[again[0] :]) < RIGHT_M
    assert np.min(causal[at : again[0]].max(axis=1)) > 0.1  # what was known then is not made better than it was


@pytest.mark.parametrize("angle_deg", [40.0, 120.0])
def test_a_robot_that_rolled_out_of_sight_is_found_in_the_first_picture(angle_deg: float) -> None:
    """It comes back lying on another side after one second: rods and cables fit as well as before, and one cap may be
    where another was, but all names and places are right at once."""
    p_WE = np.tile(at_rest(), (60, 1, 1))
    p_WE[25:] = rolled(at_rest(), np.radians(angle_deg))
    gone = np.zeros(p_WE.shape[:2], dtype=bool)
    gone[20:50] = True
    found = swept(p_WE, gone)
    assert np.max(off(found, p_WE)[~gone]) < RIGHT_M
    assert np.isnan(off(found, p_WE)[gone]).all()
    assert np.flatnonzero(found.searched).tolist() == [50]


def test_a_far_prediction_makes_no_cap_missing() -> None:
    """A robot 0.6 m from where it is expected, to 20 mm: the blobs are still all of its caps, told by the cables."""
    robot, p = known(), at_rest()
    ends = np.array([cable.caps for cable in robot.cables])
    length = np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=-1)
    predicted = (p + ELSEWHERE, np.tile(4e-4 * np.eye(3), (len(p), 1, 1)))
    found = label(list(p.reshape(-1, 2, 3)), robot, length, predicted=predicted, partly=True)
    assert found is not None
    np.testing.assert_array_equal(found.pick, np.arange(len(p)) % 2)


def test_doubt_ends_with_nearly_all_caps_seen_or_a_new_start() -> None:
    """Two caps seen after a blind spell are no proof; five of six are, as long as rods and sensors fit."""
    doubt, none = Doubt(6), np.zeros(6, dtype=bool)
    two, five = np.arange(6) < 2, np.arange(6) < 5
    doubt.wait(0.9 * BLIND_S)
    assert not doubt.whole
    doubt.wait(0.2 * BLIND_S)
    assert doubt.whole
    for used, consistent in ((two, True), (five, False)):
        doubt.look(used, used)
        doubt.judge(consistent=consistent, used=used)
        assert doubt.whole
    doubt.judge(consistent=True, used=five)
    assert not doubt.whole
    for _ in range(REFUSED):
        assert not doubt.whole
        doubt.look(five, none)
    assert doubt.whole
    doubt.believe()
    assert not doubt.whole


def test_a_cap_that_is_missed_is_looked_for_elsewhere_now_and_then() -> None:
    """Soon after it was last seen, and not in every frame."""
    doubt, others = Doubt(6), np.arange(6) != 3
    doubt.believe()
    asked = []
    for k in range(60):
        doubt.wait(FRAME_S)
        if doubt.missing:
            asked.append(k * FRAME_S)
            doubt.searched()
        doubt.look(others, others)
    assert asked[0] == pytest.approx(MISSED_S, abs=2 * FRAME_S)
    assert np.all(np.diff(asked) > AGAIN_S)
    assert len(asked) == pytest.approx((60 * FRAME_S - MISSED_S) / AGAIN_S, abs=1)


def test_a_cap_that_was_not_found_goes_with_those_that_were() -> None:
    """Five caps of a robot 0.6 m off: the sixth is expected where rods and cables have it there."""
    robot, p = known(), at_rest()
    forward = Forward(robot)
    forward.start(0.0, p)
    ends = np.array([robot.cables[sensor.cable].caps for sensor in robot.sensors])
    forward.sense(0.5, np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=-1))
    forward.predict(0.5)
    there = p + ELSEWHERE
    assert forward.reacquire(0.5, [there[:2], there[2:4], there[4:5]], 1e-6 * np.eye(3))
    np.testing.assert_allclose(forward.p_WE, there, atol=0.02)

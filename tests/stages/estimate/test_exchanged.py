"""Colours in robot.toml that belong to other rods: the lengths of the cable sensors tell, where anything moves."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.exchanged import check_names, lengths_at, namings
from r2s2r_cli.stages.estimate.motion.data import Readings, Sighted
from tests.support.rig_robots import known

ROBOT = known()
N, LATE_S = 200, 0.04


def run(seed: int, *, moves_m: float = 0.02, noise_m: float = 0.003) -> tuple[Sighted, Readings]:
    """Caps that wander about the shape at rest, seen to 1 mm; sensors with an offset of 4 mm and noise, 40 ms late."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / 30
    wave = np.sin(2 * np.pi * rng.uniform(0.1, 0.4, (1, 6, 3)) * t[:, None, None] + rng.uniform(0, 6, (1, 6, 3)))
    p = np.array(ROBOT.rest_caps_m) + moves_m * wave
    ends = np.array([ROBOT.cables[sensor.cable].caps for sensor in ROBOT.sensors])
    length = np.linalg.norm(p[:, ends[:, 1]] - p[:, ends[:, 0]], axis=-1)
    shown = length + 0.004 * rng.standard_normal(len(ends)) + noise_m * rng.standard_normal(length.shape)
    seen = p + 0.001 * rng.standard_normal(p.shape)
    seen[rng.random((N, 6)) < 0.2] = np.nan
    cable = np.array([sensor.cable for sensor in ROBOT.sensors])
    return Sighted(t, seen, np.tile(1e-6 * np.eye(3), (N, 6, 1, 1))), Readings(t + LATE_S, shown, cable)


def renamed(sighted: Sighted, naming: np.ndarray) -> Sighted:
    """Cap k of the robot goes by the name naming[k]."""
    p = np.full_like(sighted.p_WE, np.nan)
    p[:, naming] = sighted.p_WE
    return Sighted(sighted.t, p, sighted.cov)


@pytest.mark.parametrize("seed", range(100, 104))
def test_right_names_pass(seed: int) -> None:
    """Offset, noise, delay and hidden caps are no reason to doubt."""
    sighted, readings = run(seed)
    assert check_names(sighted, readings, ROBOT, where="here") == (None, None)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3)))[1:])
def test_other_names_are_refused(order: tuple[int, ...]) -> None:
    """Every exchange and rotation of the colours, and the message has the rods that have each other's."""
    sighted, readings = run(105)
    naming = np.array([2 * rod + end for rod in order for end in (0, 1)])
    with pytest.raises(InputError, match="exchanged") as caught:
        check_names(renamed(sighted, naming), readings, ROBOT, where="here")
    for rod, of in enumerate(order):
        told = f"rod {ROBOT.rods[rod].name} has that of rod {ROBOT.rods[of].name}"
        assert (told in caught.value.what) == (rod != of)


@pytest.mark.parametrize("naming", [(0, 1, 3, 2, 4, 5), (1, 0, 3, 2, 5, 4)])
def test_even_and_odd_caps_exchanged_get_their_names_back(naming: tuple[int, ...]) -> None:
    """The caps of one rod, or of all (a prism at rest looks the same after half a turn): robot.toml is not to blame."""
    sighted, readings = run(106)
    wrong = renamed(sighted, np.array(naming))
    names, told = check_names(wrong, readings, ROBOT, where="here")
    assert names is not None and told is not None and "taken for each other" in told
    np.testing.assert_array_equal(wrong.p_WE[:, names], sighted.p_WE)
    assert check_names(Sighted(wrong.t, wrong.p_WE[:, names], wrong.cov), readings, ROBOT, where="here")[0] is None


def test_a_robot_that_hardly_moves_cannot_tell() -> None:
    """0.5 mm of motion under 8 mm of noise: a warning, whatever the names are. No sensors: the report says it."""
    sighted, readings = run(107, moves_m=0.0005, noise_m=0.02)
    names, told = check_names(sighted, readings, ROBOT, where="here")
    assert names is None and told is not None and "nobody can tell" in told
    assert check_names(sighted, None, ROBOT, where="here") == (None, None)


def test_every_naming_is_tried_once() -> None:
    """3 rods: 3! orders times 2^3 ends, the names as they are first; many rods: exchanges of two alone."""
    names = [tuple(name) for name in namings(3)]
    assert len(set(names)) == len(names) == 48
    assert names[0] == tuple(range(6))
    assert len(list(namings(6))) == 1 + 15


def test_lengths_are_means_near_the_frames() -> None:
    """Samples of 10 ms about a frame, one silent: the mean of the others; none near: NaN."""
    readings = Readings(np.array([0.95, 1.0, 1.05, 3.0]), np.array([[1.0], [2.0], [np.nan], [9.0]]), np.array([0]))
    found = lengths_at(np.array([1.0, 2.0]), readings)
    assert found[0, 0] == pytest.approx(1.5)
    assert np.isnan(found[1, 0])

"""Hidden worlds: nothing wrong is told from nothing, and what is wrong grows with its size."""

import json
import tomllib
from dataclasses import asdict, replace
from typing import Literal

import numpy as np
import pytest

from r2s2r_cli.blind.make.drive import Driven, drive, random_gait
from r2s2r_cli.blind.make.effects import STARRED
from r2s2r_cli.blind.make.oracle import detectability
from r2s2r_cli.blind.make.outside import OUTSIDE
from r2s2r_cli.blind.make.worlds import STRANGE_WITHOUT_RIG, WITHOUT_RIG, Hidden, hidden
from r2s2r_cli.blind.make.write import robot_text
from r2s2r_cli.blind.split import Bank, Kind, judged
from schemas.robot import Robot
from tests.support.soak import drawn

SEED = 150_321


def driven(world: Hidden) -> tuple[Robot, list[Driven]]:
    """One short gait."""
    robot = Robot.model_validate(tomllib.loads(robot_text(world.tolerance)))
    gait = random_gait("g1", np.random.default_rng(5))
    return robot, [drive(robot, world, replace(gait, targets=gait.targets[:2]), 0, exposures=10.0, phase=0.3)]


@pytest.mark.slow
@pytest.mark.parametrize("tier", ["A", "B"])
def test_without_an_effect_there_is_nothing_to_tell(tier: Literal["A", "B"]) -> None:
    """Every interval, simulated again from its true start under the same duties, comes out the same: d = 0."""
    world = hidden(Bank.CALIBRATION, SEED, Kind.NONE, gaits=1, tier=tier)
    robot, runs = driven(world)
    found = detectability(robot, world, runs)
    assert found.d < 1e-6 and found.gap_mm < 1e-6 and found.stratum == "sub-floor"


@pytest.mark.slow
@pytest.mark.parametrize("tier", drawn(("B",), ("A", "B")))
def test_what_is_wrong_grows_with_its_size(tier: Literal["A", "B"]) -> None:
    """A sensor's bias moves no cap but shows in its length: d follows the bias until one interval counts no more."""
    d = []
    for s in (0.05, 0.1, 1.0):
        world = hidden(Bank.CALIBRATION, SEED, Kind.SINGLE, gaits=1, tier=tier, effects=("sensor_bias",), factor=s)
        robot, runs = driven(world)
        found = detectability(robot, world, runs)
        d.append(found.d)
        assert found.gap_mm < 1e-6
    assert d[1] == pytest.approx(2 * d[0], rel=0.05) and d[0] < 3 < d[2]


def test_every_effect_and_every_strange_thing_is_a_world() -> None:
    """Each makes a table that the rig accepts, at every size of the banks, and a label that is JSON."""
    for s in (0.025, 1.4):
        for name in STARRED:
            world = hidden(Bank.BLIND, 500_001, Kind.SINGLE, effects=(name,), factor=s, gaits=3)
            (one,) = world.planted
            made = world.world(2, np.zeros(2), 0.0)
            assert one.id == name and [key for key, _ in made.effects.present()] == [name]
            assert json.loads(json.dumps(asdict(one)))["id"] == name
        for name in OUTSIDE:
            strange = hidden(Bank.BLIND, 500_001, Kind.OUTSIDE, strange=name, factor=s).strange
            assert strange is not None and json.loads(json.dumps(asdict(strange[1])))["channel"] == strange[1].channel
    assert set(STARRED) >= WITHOUT_RIG and set(OUTSIDE) >= set(STRANGE_WITHOUT_RIG) and len(STARRED) == 26


def test_worlds_of_a_seed_differ_in_what_is_wrong_alone() -> None:
    """Friction, speed, noise and sensors of the day are those of the seed, whatever is planted."""
    plain = hidden(Bank.CALIBRATION, SEED, Kind.NONE)
    wrong = hidden(Bank.CALIBRATION, SEED, Kind.SINGLE, effects=("payload",))
    assert wrong.planted and not plain.planted
    for name in ("friction", "speed", "tolerance", "noise_m", "ar1", "rate_hz", "gaits"):
        assert getattr(plain, name) == getattr(wrong, name)
    assert np.array_equal(plain.day, wrong.healthy().day)
    other = hidden(Bank.CALIBRATION, SEED + 1, Kind.NONE)
    assert other.friction != plain.friction and 0.45 <= other.friction <= 1.0


def test_other_noise_is_the_same_world() -> None:
    """`--noise`: below 10 mm sizes are drawn alike, so that what is wrong is what it was, and as large."""
    drawn = next(
        world for seed in range(SEED, SEED + 40)
        if (world := hidden(Bank.CALIBRATION, seed, Kind.SINGLE)).noise_m == 0.005
    )  # fmt: skip
    told = hidden(Bank.CALIBRATION, drawn.seed, Kind.SINGLE, noise_m=0.001)
    assert told.noise_m == 0.001 and np.array_equal(told.day, drawn.day)
    assert replace(told, noise_m=0.005, day=drawn.day) == drawn


@pytest.mark.parametrize("gaits", [3, 5, 8])
def test_what_begins_late_begins_in_a_gait_that_is_fitted(gaits: int) -> None:
    """A knock, or a push, that only the judged gaits have could be learned of by nobody."""
    for seed in range(SEED, SEED + 40):
        knocked = hidden(Bank.CALIBRATION, seed, Kind.SINGLE, effects=("camera_pose",), gaits=gaits).planted[0].late
        once = hidden(Bank.CALIBRATION, seed, Kind.OUTSIDE, strange="lateral_push", gaits=gaits).strange
        assert knocked is not None and once is not None and once[2] is not None
        assert max(knocked[0], once[2]) < gaits - judged(gaits)


def test_a_knocked_camera_is_straight_before_and_askew_after() -> None:
    """From its gait and time on, and in every gait after that."""
    world = hidden(Bank.CALIBRATION, SEED, Kind.SINGLE, effects=("camera_pose",), gaits=5, factor=1.0)
    late = world.planted[0].late
    assert late is not None
    cameras = [world.world(g, np.zeros(2), 0.0).seen() for g in range(5)]
    knocked = [any(camera.turn_rad) for camera in cameras]
    assert knocked == [g >= late[0] for g in range(5)]
    assert cameras[late[0]].knocked_at_s == late[1]
    assert all(camera.knocked_at_s == 0.0 for camera in cameras[late[0] + 1 :])

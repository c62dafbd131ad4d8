"""Pictures of a run in a hidden world: what the camera has wrong acts on the pictures, and on nothing else."""

import tomllib
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from r2s2r_cli.artifact import Blobs, Group
from r2s2r_cli.blind.make.drive import Driven, drive, random_gait
from r2s2r_cli.blind.make.film import film
from r2s2r_cli.blind.make.worlds import CAMERA_HZ, Hidden, hidden
from r2s2r_cli.blind.make.write import robot_text
from r2s2r_cli.blind.split import Bank, Kind
from schemas.robot import Robot

SEED = 1_305
FRAMES = 4


@pytest.fixture(scope="module")
def run() -> tuple[Robot, Driven]:
    """The robot at rest, before its first target, and some frames of that."""
    world = hidden(Bank.REGRESSION, SEED, Kind.NONE, camera=True)
    robot = Robot.model_validate(tomllib.loads(robot_text(world.tolerance)))
    gait = random_gait("g1", np.random.default_rng(5))
    found = drive(robot, world, replace(gait, targets=gait.targets[:0]), 0, exposures=world.rate_hz, phase=0.3)
    return robot, replace(found, t_frame=found.t_frame[:FRAMES], p_WE=found.p_WE[:FRAMES])


def filmed(run: tuple[Robot, Driven], *, seed: int = 1, **changed: Any) -> Group:
    """The stream of the camera with some of its settings changed."""
    robot, driven = run
    plain = hidden(Bank.REGRESSION, SEED, Kind.NONE, camera=True)
    camera = plain.world(0, driven.gait.position, driven.gait.heading).seen().model_copy(update=changed)
    return film(driven, camera, robot, np.random.default_rng(seed))


def pictures(group: Group, name: str = "color") -> list[np.ndarray]:
    """Decoded."""
    blobs = group.datasets[name]
    assert isinstance(blobs, Blobs)
    mode = cv2.IMREAD_COLOR if name == "color" else cv2.IMREAD_UNCHANGED
    return [cv2.imdecode(np.frombuffer(one, np.uint8), mode) for one in blobs.items]


def clock(run: tuple[Robot, Driven], **changed: float) -> Any:
    """Settings of the camera's clock, changed."""
    camera = hidden(Bank.REGRESSION, SEED, Kind.NONE, camera=True).world(0, run[1].gait.position, 0.0).seen()
    return camera.clock.model_copy(update=changed)


def test_a_picture_an_exposure_as_the_camera_describes_itself(run: tuple[Robot, Driven]) -> None:
    """Colour and depth in pairs, the stated lens and pose; depth of the floor is what the pose says."""
    group = filmed(run)
    assert np.array_equal(group["t"], run[1].t_frame) and group["pair"].tolist() == [0, 1, 2, 3]
    color, depth = pictures(group), pictures(group, "depth")
    assert len(color) == len(depth) == FRAMES and color[0].shape == (480, 640, 3) and depth[0].dtype == np.uint16
    assert group["X_WC"][2, 3] == pytest.approx(1.44) and group.attributes["fx"] == 607.7
    floor = depth[0][:40][depth[0][:40] > 0] * group.attributes["depth_scale"]
    assert np.median(floor) == pytest.approx(1.44, abs=0.01)


def test_the_same_draw_gives_the_same_pictures_and_another_draw_others(run: tuple[Robot, Driven]) -> None:
    """To the last bit; another draw shows the same robot."""
    one, same, other = (pictures(filmed(run, seed=seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(one, same, strict=True))
    assert not any(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    coloured = [picture.max(axis=2).astype(int) - picture.min(axis=2) > 100 for picture in (one[0], other[0])]
    assert (coloured[0] & coloured[1]).sum() > 0.8 * (coloured[0] | coloured[1]).sum() > 100


def test_stamps_are_late_and_what_falls_out_of_the_log_is_gone(run: tuple[Robot, Driven]) -> None:
    """A delay shifts the stamps; frames before the log begins have no place in it."""
    late = filmed(run, clock=clock(run, stamp_delay_s=0.08, lost_share=0.0))
    assert late["t"] == pytest.approx(run[1].t_frame + 0.08)
    early = filmed(run, clock=clock(run, stamp_delay_s=-0.08, lost_share=0.0))
    assert early["t"] == pytest.approx(run[1].t_frame[1:] - 0.08) and len(pictures(early)) == FRAMES - 1


def test_lost_frames_have_neither_stamp_nor_picture(run: tuple[Robot, Driven]) -> None:
    """Of all that are lost nothing is left."""
    gone = filmed(run, clock=clock(run, lost_share=1.0))
    assert len(gone["t"]) == 0 and pictures(gone) == pictures(gone, "depth") == []


def test_a_knock_is_in_the_pictures_and_not_in_the_stated_pose(run: tuple[Robot, Driven]) -> None:
    """From its time on the robot lies elsewhere in the picture."""
    at = float(run[1].t_frame[2])
    straight, knocked = filmed(run), filmed(run, shift_m=(0.05, 0.0, 0.0), knocked_at_s=at)
    assert np.array_equal(straight["X_WC"], knocked["X_WC"])
    change = [np.abs(a.astype(int) - b).max() for a, b in zip(pictures(straight), pictures(knocked), strict=True)]
    assert max(change[:2]) == 0 and min(change[2:]) > 100


def test_another_scale_is_in_the_depths_and_not_in_the_stated_lens(run: tuple[Robot, Driven]) -> None:
    """Depths of 5 % more."""
    plain, deep = filmed(run), filmed(run, depth_error=0.05)
    assert plain.attributes == deep.attributes
    ratio = np.median(pictures(deep, "depth")[0]) / np.median(pictures(plain, "depth")[0])
    assert ratio == pytest.approx(1.05, abs=0.005)


def test_a_world_with_pictures_is_the_same_world() -> None:
    """Friction, speed, what is planted: but for how it is looked at."""
    plain, seen = (hidden(Bank.REGRESSION, SEED, Kind.PAIR, camera=camera) for camera in (False, True))
    assert seen.camera and seen.rate_hz == CAMERA_HZ
    alike: Hidden = replace(seen, camera=False, noise_m=plain.noise_m, ar1=plain.ar1, rate_hz=plain.rate_hz,
                            day=plain.day)  # fmt: skip
    assert alike == plain and np.array_equal(seen.day, plain.day)

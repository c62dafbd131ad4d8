"""The example of the uneven floor: two worlds that differ in the patch alone, a split that mixes nothing, its table."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.store.toml import load_model
from schemas.robot import Robot
from tests.examples.load import load

floors = load("16_uneven_floor", "floors")
uneven = load("16_uneven_floor", "uneven")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with the robot that is known."""
    (tmp_path / "robot.toml").write_text(robot_toml("threebar"), "utf-8")
    return tmp_path


def test_the_floors_differ_in_the_patch_alone(project: Path) -> None:
    """Same sensors and camera; one has the patch. The robot is another one than robot.toml in friction and speed."""
    drawn = floors.draw(project, 0)
    even, other = (load_model(project / f"{name}.toml", World) for name in ("even", "uneven"))
    assert even.effects.friction_field is None and other.effects.friction_field is not None
    (patch,) = other.effects.friction_field.patches
    assert patch.factor == floors.PATCH["factor"] and list(patch.center_m) == floors.PATCH["center_m"]
    assert other.model_copy(update={"effects": even.effects}) == even
    true, told = (load_model(project / f"{name}.toml", Robot) for name in ("truth", "robot"))
    assert true.contact.friction == pytest.approx(drawn["friction"], abs=1e-4) and drawn["friction"] < 0.5
    assert true.motors[0].no_load_rad_per_s == pytest.approx(
        told.motors[0].no_load_rad_per_s * drawn["speed"], rel=1e-3
    )
    assert true.cables == told.cables
    assert floors.draw(project, 0) == drawn != floors.draw(project, 1)


def test_the_robot_is_put_on_one_floor(project: Path) -> None:
    """world.toml is the floor that was laid last."""
    floors.draw(project, 0)
    for name in ("uneven", "even"):
        floors.lay(project, name)
        assert (project / "world.toml").read_text("utf-8") == (project / f"{name}.toml").read_text("utf-8")


def test_nothing_is_learned_from_what_is_predicted() -> None:
    """Every repeat of one policy trains, every repeat of the others is held out."""
    words = uneven.split()
    pairs = list(zip(words[::2], words[1::2], strict=True))
    train, test = ({run for option, run in pairs if option == which} for which in ("--train", "--test"))
    assert len(train) == uneven.REPEATS and len(test) == 2 * uneven.REPEATS
    assert all(run.startswith(uneven.LEARNED) for run in train) and not train & test


def test_a_row_is_the_root_mean_square_of_the_repeats() -> None:
    """Of 3 and 4 degrees 3.5, of 30 and 40 mm 35."""
    runs = [
        {"heading_end_error_rad": math.radians(one), "com_end_error_m": 0.01 * one, "keyframe_cap_rmse_m": 0.001 * one}
        for one in (3.0, 4.0)
    ]
    assert uneven._cells(runs).split() == ["3.5", "35.4", "3.5"]

"""`compare` on runs whose true simulator is known: it is told from a wrong one, and the wrong one's error is seen."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.commands.conftest import invoke
from tests.support.simulated_log import SPEED, simulated_project

pytestmark = pytest.mark.slow

GAIT = """\
schema_version = 1
robot = "threebar"
name = "gait"
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
hold_s = 1.0
[[steps]]
target = [0.2, 1.0, 1.0, 1.0, 0.3, 1.0]
[[steps]]
target = [1.0, 0.4, 1.0, 0.2, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with an estimated log of its own robot; its robot.toml says that the motors are 40 % slower."""
    root = tmp_path_factory.mktemp("compare") / "bot"
    simulated_project(root, GAIT, told=0.6 * SPEED)
    return root


def compared(root: Path, *options: str) -> dict[str, object]:
    """The report of one simulator."""
    result = invoke("compare", "--project", str(root), "--json", "--no-draw", "--force", *options)
    assert result.exit_code == 0, result.stderr
    (run,) = json.loads(result.stdout)["report"]["runs"]
    return run


def test_a_wrong_motor_speed_is_seen_as_time_and_the_right_one_leaves_the_noise(walked: Path) -> None:
    """Motors at 60 % take longer for the same gait. With the true speed what is left is the start state: a frame shows
    it to a few millimetres only, for roll and rest lengths are not seen."""
    slow = compared(walked)
    robot = walked / "robot.toml"
    told = robot.read_text()
    robot.write_text(told.replace(f"speed = {0.6 * SPEED}", f"speed = {SPEED}"))
    true = compared(walked)
    robot.write_text(told)
    # Of what follows the rest that the run opens with; the last one is cut off before its end.
    assert slow["intervals"] == true["intervals"] == 2
    assert true["opening"]["duration_s"] == pytest.approx(1.0, abs=0.2)
    assert true["opening"]["moved_m"] < 0.005
    assert slow["duration_s"]["sim"] > 1.2 * slow["duration_s"]["real"]
    assert true["duration_s"]["sim"] == pytest.approx(true["duration_s"]["real"], abs=0.15)
    assert true["keyframe_cap_rmse_m"] < 0.4 * slow["keyframe_cap_rmse_m"]
    assert true["com_end_error_m"] < 0.005


def test_a_single_run_has_no_floor_and_says_so(walked: Path) -> None:
    """Nothing is claimed of an error that may be the robot's own scatter."""
    result = invoke("compare", "--project", str(walked), "--no-draw", "--force")
    assert "no policy was run twice" in result.stderr
    assert set(compared(walked)["floor"].values()) == {None}


def test_the_pictures_and_the_page_show_the_run(walked: Path) -> None:
    """Self-contained, with a picture a run."""
    result = invoke("compare", "--project", str(walked), "--force")
    assert result.exit_code == 0, result.stderr
    folder = walked / "iterations" / "001"
    assert (folder / "60-compare-gait.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "60-compare.html").read_text()
    assert "Table II, runs of iteration 1" in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_a_missing_estimate_and_a_missing_model_are_bad_input(project: Path) -> None:
    """Exit code 4, with the command that makes what is missing."""
    invoke("import", "sample.csv")
    result = invoke("compare")
    assert result.exit_code == 4
    assert "r2s2r estimate --iteration 1" in result.stderr
    assert invoke("estimate", "--no-draw").exit_code == 0
    assert invoke("compare", "--model", "nowhere.h5").exit_code == 4

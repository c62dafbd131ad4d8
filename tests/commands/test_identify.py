"""`identify` in a project: a simulated log in, numbers with their worth out; again, interrupted, and taken up."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from r2s2r_cli.stages.identified import Identified, identified as made_of
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke
from tests.support.engine import threebar
from tests.support.layouts import same
from tests.support.simulated_log import simulated_project

pytestmark = pytest.mark.slow

IDENTIFY = "iterations/001/30-identify.h5"
GAIT = """\
schema_version = 1
robot = "threebar"
name = "gait"
[[steps]]
target = [1.0, 0.3, 1.0, 1.0, 0.4, 1.0]
[[steps]]
target = [0.2, 1.0, 1.0, 0.3, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 0.3, 1.0, 1.0, 0.2]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""
ASK = ("--train", "gait:1-3", "--free", "motor_speed", "--free", "friction", "--starts", "1",
       "--set", "identify.profiles=1")  # fmt: skip
START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits "ignore"
sys.argv = ["r2s2r", "identify", *{arguments!r}]
from r2s2r_cli.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of the engine's own robot, estimated; then robot.toml is made wrong by a fifth, and identified."""
    root = tmp_path_factory.mktemp("identified") / "robot"
    simulated_project(root, GAIT, told=0.64)
    result = invoke("identify", *ASK, "--project", str(root))
    assert result.exit_code == 0, result.stderr
    return root


@pytest.fixture
def identified(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that project, as the working directory."""
    root = tmp_path / "robot"
    shutil.copytree(template, root)
    monkeypatch.chdir(root)
    return root


def test_what_it_writes_validates(identified: Path) -> None:
    """The artifact has no error; the page and its pictures lie beside it; no checkpoint is left."""
    result = invoke("validate", IDENTIFY)
    assert result.exit_code == 0, result.stdout
    names = {path.name for path in (identified / "iterations/001").glob("30-identify*")}
    assert names >= {"30-identify.h5", "30-identify.html", "30-identify-parameters.png", "30-identify-fit-gait.png",
                     "30-identify-free-gait.png"}  # fmt: skip
    assert "30-identify.partial" not in names


def test_the_planted_speed_comes_back(identified: Path) -> None:
    """0.8 was simulated, the fit began at 0.64: within three standard deviations or 5 %; held out it predicts."""
    answer = document("identify", *ASK)
    assert answer["state"] == "fresh"
    speed = answer["parameters"]["motor_speed"]
    assert speed["identifiable"] and abs(speed["value"] - 0.8) < max(3 * speed["sd"], 0.04)
    held = answer["heldout"]
    assert held["keyframe_cap_rmse_m"] < held["baselines"]["nothing moves"]["keyframe_cap_rmse_m"]
    assert answer["rollouts"] > 0 and answer["wall_s"] > 0


def test_another_robot_makes_it_stale_and_status_says_how_to_go_on(identified: Path) -> None:
    """A number of robot.toml that the simulator uses; the command of status has the options that were given."""
    robot = identified / "robot.toml"
    robot.write_text(robot.read_text().replace("friction = 0.76", "friction = 0.5 "))
    state = document("status")
    assert state["artifacts"][-2]["artifact"] == IDENTIFY or state["artifacts"][-1]["artifact"] == IDENTIFY
    assert state["next"].startswith("r2s2r")
    reasons = document("identify", *ASK, "--dry-run")["reasons"]
    assert reasons == ["robot.toml: contact.friction was 0.76, is 0.5"]


def test_an_unknown_parameter_has_a_near_match(identified: Path) -> None:
    """Exit code 2, what was probably meant, and the artifact stays."""
    before = (identified / IDENTIFY).read_bytes()
    result = invoke("identify", "--free", "motor_sped")
    assert result.exit_code == 2
    assert "motor_speed" in result.stderr.splitlines()[-1]
    assert (identified / IDENTIFY).read_bytes() == before


def test_one_interval_is_too_few(identified: Path) -> None:
    """Nothing could be held out of it: a log of one target is bad input."""
    text = (identified / "log" / "gait.csv").read_text().splitlines()
    columns = [k for k, name in enumerate(text[0].split(",")) if name.startswith("target")]
    targets = [[line.split(",")[k] for k in columns] for line in text[1:]]
    begins = [k for k in range(1, len(targets)) if targets[k] != targets[k - 1]]
    shutil.rmtree(identified / "iterations")
    (identified / "log" / "gait.csv").write_text("\n".join([text[0], *text[begins[0] + 1 : begins[1] + 1]]) + "\n")
    assert invoke("import", "log/gait.csv", "--no-draw").exit_code == 0
    assert invoke("estimate", "--no-draw").exit_code == 0
    result = invoke("identify", "--free", "motor_speed")
    assert result.exit_code == 4, result.stderr
    assert "one target interval is not enough" in result.stderr or "the targets never change" in result.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_a_checkpoint_and_resume_ends_the_same(identified: Path, number: signal.Signals) -> None:
    """Interrupted it leaves with 130, the artifact as it was; taken up, it leaves the artifact of the whole fit."""
    before = read_header(identified / IDENTIFY).content_sha256
    whole = read_artifact(identified / IDENTIFY, "identification")[1]
    code = START.format(arguments=[*ASK, "--force", "--no-draw"])
    child = subprocess.Popen([sys.executable, "-c", code], cwd=identified, stdout=subprocess.DEVNULL,
                             stderr=subprocess.PIPE, text=True, env={**os.environ})  # fmt: skip
    checkpoint = identified / "iterations/001/30-identify.partial"
    deadline = time.monotonic() + 300
    while not checkpoint.exists() and child.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    child.send_signal(number)
    _, stderr = child.communicate(timeout=300)
    assert child.returncode == 130, stderr
    assert "--resume" in stderr and "Traceback" not in stderr
    assert read_header(identified / IDENTIFY).content_sha256 == before
    assert checkpoint.exists()
    refused = invoke("identify", *ASK, "--seed", "9", "--resume")
    assert refused.exit_code == 2 and "another request" in refused.stderr
    assert document("identify", *ASK, "--resume", "--no-draw")["state"] == "done"
    again = read_artifact(identified / IDENTIFY, "identification")[1]
    assert same(again, whole)
    assert not checkpoint.exists()


def test_the_self_test_writes_nothing(identified: Path) -> None:
    """Two planted robots: truths, bias and coverage as one document; the project is as it was."""
    before = {path: path.stat().st_mtime_ns for path in (identified / "iterations").rglob("*")}
    result = invoke("identify", *ASK, "--self-test", "--set", "identify.self_test_cases=2", "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)["report"]
    assert set(report["parameters"]) == {"motor_speed", "friction"}
    assert len(report["cases"]) == 2
    assert {path: path.stat().st_mtime_ns for path in (identified / "iterations").rglob("*")} == before


def test_an_effect_stays_and_the_next_iteration_starts_from_it(identified: Path) -> None:
    """A payload that is not there: its mass is fitted to next to nothing, with its place given; whoever simulates has
    the effect, and so has the next iteration, which names none, until it names `none`; `compare` shows before and
    after, both nearer than a robot.toml that is wrong by a fifth."""
    ask = ("--train", "gait:1-3", "--free", "motor_speed", "--starts", "1", "--set", "identify.profiles=1")
    asked = ("--with-effect", "payload:0", "--fix", "payload.place_m.0=0.1")
    found = document("identify", *ask, *asked, "--force")["parameters"]
    mass = found["payload.mass_kg.0"]
    assert mass["value"] < max(3 * mass["sd"], 0.01)
    assert "payload.place_m.0" in found
    own = identified_simulator(identified / IDENTIFY)
    assert [effect.name for effect in own.structure.effects] == ["payload"]
    assert float(own.theta.extra["payload.place_m"][0, 0]) == 0.1
    again = document("identify", *ask, "--iteration", "2")["parameters"]
    assert again["payload.mass_kg.0"]["value"] == pytest.approx(mass["value"], abs=0.01)
    assert again["payload.place_m.0"]["value"] == 0.1
    bare = document("identify", *ask, "--iteration", "3", "--with-effect", "none")["parameters"]
    assert set(bare) == {"motor_speed"}
    models = ("--model", "before=iterations/003/30-identify.h5", "--model", f"after={IDENTIFY}")
    compared = document("compare", "--iteration", "1", "--of", "record", *models, "--no-draw")["report"]
    errors = {one["model"]: one["runs"]["keyframe_cap_m"]["rms"] for one in compared["models"]}
    assert set(errors) == {"initial", "before", "after"} and errors["after"] != errors["before"]
    assert max(errors["before"], errors["after"]) < errors["initial"]


def identified_simulator(path: Path) -> Identified:
    """As plan, simulate and compare take it."""
    return made_of(read_artifact(path, "identification")[1], threebar())

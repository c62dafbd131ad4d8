"""`simulate` in a project: what it writes, when it runs again, and what it refuses."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from r2s2r_cli.commands.simulate_inputs import Asked
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import SHARED_CACHE, Project
from r2s2r_cli.store.read import read_artifact
from schemas.config import ProjectFile
from tests.commands.conftest import document, invoke

SIMULATION = "iterations/001/simulation.h5"
POLICY = """\
schema_version = 1
robot = "threebar"
name = "bend"
[[steps]]
target = [1.0, 0.6, 1.0, 1.0, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""
START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits "ignore"
sys.argv = ["r2s2r", "simulate", "--random", "1000", "--quiet"]
from r2s2r_cli.__main__ import main
print("started", file=sys.stderr, flush=True)
main()
"""


@pytest.fixture(scope="module")
def template(templates: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The estimated sample with a policy that has been simulated and drawn; its step is compiled."""
    root = tmp_path_factory.mktemp("simulated") / "robot"
    shutil.copytree(templates / "done", root)
    (root / "policies").mkdir()
    (root / "policies" / "bend.toml").write_text(POLICY)
    result = invoke("simulate", str(root / "policies" / "bend.toml"), "--project", str(root))
    assert result.exit_code == 0, result.stderr
    return root


@pytest.fixture
def simulated(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that project, as the working directory."""
    root = tmp_path / "robot"
    shutil.copytree(template, root)
    monkeypatch.chdir(root)
    return root


def test_what_it_writes_validates(simulated: Path) -> None:
    """The artifact has no error and no warning; picture and page lie beside it."""
    result = invoke("validate", SIMULATION)
    assert result.exit_code == 0
    assert "0 errors, 0 warnings" in result.stdout + result.stderr
    folder = simulated / "iterations/001"
    assert {path.name for path in folder.glob("simulation*")} == {
        "simulation.h5",
        "simulation.html",
        "simulation-bend.png",
    }
    assert (folder / "simulation.html").stat().st_size < 1_000_000


def test_the_run_is_that_of_the_policy(simulated: Path) -> None:
    """The policy is stored with its run, driven in closed loop."""
    _, data = read_artifact(simulated / SIMULATION, "simulation")
    assert data.runs() == ["bend"]
    assert data.groups["runs/bend/policy"]["target"][0].tolist() == [1.0, 0.6, 1.0, 1.0, 1.0, 1.0]
    assert data.groups["runs/bend"].attributes["control"] == "closed loop"
    assert data.groups["runs/bend/intervals"]["complete"].all()


def test_a_fresh_simulation_is_not_made_again(simulated: Path) -> None:
    """The same command says fresh; what the policy says or the robot is makes it stale, a comment does not."""
    before = (simulated / SIMULATION).read_bytes()
    assert document("simulate", "policies/bend.toml")["state"] == "fresh"
    assert (simulated / SIMULATION).read_bytes() == before
    robot = simulated / "robot.toml"
    robot.write_text(robot.read_text().replace("friction = 0.76", "friction = 0.5 "))
    reasons = document("simulate", "policies/bend.toml", "--dry-run")["reasons"]
    assert reasons == ["robot.toml: contact.friction was 0.76, is 0.5"]
    assert "contact.friction" in invoke("status").stdout


def test_a_changed_policy_makes_the_simulation_stale(simulated: Path) -> None:
    """The policy file is an input like any other; status names the command that simulates it again."""
    path = simulated / "policies" / "bend.toml"
    path.write_text(path.read_text().replace("0.6", "0.7"))
    state = document("status")
    assert state["artifacts"][-1]["state"] == "stale"
    assert state["next"] == "r2s2r simulate policies/bend.toml --iteration 1"


def test_the_same_request_gives_the_same_content(simulated: Path) -> None:
    """Computed again from the start nothing but times differs."""
    before = read_header(simulated / SIMULATION)
    assert document("simulate", "policies/bend.toml", "--force", "--no-draw")["state"] == "done"
    assert read_header(simulated / SIMULATION).content_sha256 == before.content_sha256


@pytest.mark.slow
def test_several_runs_in_one_call(simulated: Path) -> None:
    """A policy file, the targets of a recorded run, a random policy and a replay become a run each, all drawn."""
    answer = document(
        "simulate", "policies/bend.toml", "iterations/001/10-record.h5:sample", "--random", "1", "--seed", "7",
        "--replay", "sample", "--set", "simulate.frame_rate_hz=10.0",
    )  # fmt: skip
    runs = {run["run"]: run for run in answer["report"]["runs"]}
    assert list(runs) == ["bend", "sample", "random-7", "sample-replay"]
    assert runs["sample-replay"]["start"] == "sample" and runs["bend"]["start"] == "rest"
    assert runs["sample-replay"]["control"] == "command replay"
    assert [Path(name).name for name in answer["drawings"]][-1] == "simulation.html"
    assert invoke("validate", SIMULATION).exit_code == 0
    again = json.loads(invoke("status", "--json").stdout)["artifacts"][-1]
    assert again["state"] == "fresh"


def test_whose_numbers_were_simulated_is_said(simulated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Terminal and page; of an identification that is there and was not used both say so, with the command that uses
    it."""
    typed = ["simulate", "policies/bend.toml", "--force"]
    monkeypatch.setattr(sys, "argv", ["r2s2r", *typed])
    alone = invoke(*typed)
    assert "Simulated with the numbers of robot.toml." in alone.stdout and "was not used" not in alone.stdout
    (simulated / "iterations/001/30-identify.h5").write_bytes(b"whatever it holds")
    beside = invoke(*typed)
    assert "iterations/001/30-identify.h5 is there and was not used" in beside.stdout
    command = f"r2s2r {' '.join(typed)} --model iterations/001/30-identify.h5"
    assert f"hint: {command}" in beside.stderr
    page = (simulated / SIMULATION).with_suffix(".html").read_text()
    assert "numbers of robot.toml" in page and "was not used" in page and command in page


def test_the_numbers_of_an_identification_are_named_by_its_path(tmp_path: Path) -> None:
    """From wherever it was named; of the last iteration that has one where this one has none; nothing is unused
    then."""
    place = Project(tmp_path, ProjectFile(schema_version=1, name="p", robot="robot.toml"))
    for number in (1, 2, 3):
        (tmp_path / "iterations" / f"{number:03d}").mkdir(parents=True)
    path = tmp_path / "iterations" / "001" / "30-identify.h5"
    path.touch()
    (tmp_path / "iterations" / "003" / "30-identify.h5").touch()
    asked = Asked(place, place.iteration(2), (), 1, 0, (), None)
    assert (asked.numbers, asked.unused) == ("robot.toml", path)
    named = replace(asked, model=path)
    assert (named.numbers, named.unused) == ("iterations/001/30-identify.h5", None)


def test_a_policy_may_start_where_a_run_started(simulated: Path) -> None:
    """--from takes the first estimated state; the caps start there up to what settling moves them."""
    answer = document("simulate", "policies/bend.toml", "--from", "sample", "--no-draw")
    run = answer["report"]["runs"][0]
    _, data = read_artifact(simulated / SIMULATION, "simulation")
    _, estimate = read_artifact(simulated / "iterations/001/20-estimate.h5", "estimate")
    first = [d.groups[f"runs/{n}/frames"]["p_WE"][0] for d, n in ((data, "bend"), (estimate, "sample"))]
    assert run["start"] == "sample"
    assert abs(first[0] - first[1]).max() <= run["start_shift_m"] + 1e-9
    assert "iterations/001/20-estimate.h5" in answer["inputs"]


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        ((), 2, "there is nothing to simulate"),
        (("policies/none.toml",), 4, "the policy cannot be read"),
        (("project.toml",), 4, "unknown key"),
        (("iterations/001/10-record.h5:none",), 2, "there is no such policy"),
        (("--replay", "none"), 2, "there is no such run"),
        (("policies/bend.toml", "--from", "none"), 2, "there is no such run"),
        (("--random", "0"), 2, "random policy"),
        (("policies/bend.toml", "policies/bend.toml"), 2, "the same name"),
        (("policies/bend.toml", "--set", "simulate.step_s=0.003"), 4, "the engine step does not divide"),
        (("policies/bend.toml", "--set", "simulate.step_s=0"), 2, "simulate.step_s"),
    ],
)
def test_what_cannot_be_simulated_is_refused(
    simulated: Path, arguments: tuple[str, ...], code: int, expected: str
) -> None:
    """Each with its exit code, in words, and the artifact that is there stays."""
    before = (simulated / SIMULATION).read_bytes()
    result = invoke("simulate", *arguments, "--no-draw")
    assert result.exit_code == code, result.stderr
    assert expected in result.stderr
    assert result.stderr.splitlines()[-1].startswith("hint: ")
    assert (simulated / SIMULATION).read_bytes() == before


def test_a_simulation_that_leaves_the_finite_numbers_is_told(simulated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 6 with time, step, body and term; nothing is written."""
    from r2s2r_cli.engine import NonFiniteError

    def fail(*_: object, **__: object) -> None:
        raise NonFiniteError(step=99, time=0.099, environment=0, body="rod 1", term="v_WB")

    monkeypatch.setattr(import_module("r2s2r_cli.engine.closed_loop"), "closed_loop", fail)
    before = (simulated / SIMULATION).read_bytes()
    result = invoke("simulate", "policies/bend.toml", "--force", "--no-draw")
    assert result.exit_code == 6
    assert all(word in result.stderr for word in ("0.099 s", "step 99", "rod 1", "v_WB"))
    assert (simulated / SIMULATION).read_bytes() == before


@pytest.mark.slow
def test_a_broken_cache_is_made_again(simulated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Damaged machine code is not run: the step is compiled anew, with the same result."""
    before = read_header(simulated / SIMULATION).content_sha256
    monkeypatch.delenv(SHARED_CACHE)
    again = ("simulate", "policies/bend.toml", "--force", "--no-draw")
    assert document(*again)["state"] == "done"
    kernels = [path for path in (simulated / ".r2s2r" / "cache").rglob("*") if path.is_file()]
    assert kernels
    for path in kernels:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert document(*again)["state"] == "done"
    assert read_header(simulated / SIMULATION).content_sha256 == before


def test_show_config_lists_the_settings(project: Path) -> None:
    """The effective settings as a section of project.toml."""
    assert "step_s = 0.001" in invoke("simulate", "--show-config").stdout


@pytest.mark.slow
def test_ctrl_c_leaves_no_half_file(simulated: Path) -> None:
    """Interrupted while it loads, settles or simulates it leaves with 130 and the artifact as it was."""
    before = (simulated / SIMULATION).read_bytes()
    for delay in (0.3, 1.5, 5.0):
        child = subprocess.Popen([sys.executable, "-c", START], cwd=simulated, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.PIPE, text=True, env={**os.environ})  # fmt: skip
        assert child.stderr is not None
        child.stderr.readline()
        time.sleep(delay)
        child.send_signal(signal.SIGINT)
        _, stderr = child.communicate(timeout=180)
        assert child.returncode == 130, stderr
        assert "Traceback" not in stderr
        assert (simulated / SIMULATION).read_bytes() == before
        assert not list(simulated.rglob("*.partial"))

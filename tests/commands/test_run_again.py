"""What `run` shows for doing again what a robot did: the same runs, of the same iteration, and nobody unasked."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.header import read_header
from tests.commands.conftest import invoke
from tests.commands.test_mend import put
from tests.commands.test_run import CUT_OFF, Calls, calls
from tests.guards.listing import ROOT
from tests.support import builders

__all__ = ["calls"]
SAMPLE = ROOT / "examples" / "sample-project" / "project"
ROBOT = ("--port", "socket://nowhere:1", "--yes")
FLAGS = {"policies": ["gait.toml"], "port": "/dev/ttyUSB0", "protocol": "checked", "camera": "realsense",
         "random": None, "excite": [], "levels": 2, "repeats": 3}  # fmt: skip


@pytest.fixture
def older(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The sample project as the working directory; both iterations' runs are of an older plan than there is now."""
    root = Path(shutil.copytree(SAMPLE, tmp_path / "project"))
    monkeypatch.chdir(root)
    one, two = (root / "iterations" / name / "40-plan.h5" for name in ("001", "002"))
    kept = one.read_bytes()
    one.write_bytes(two.read_bytes())
    two.write_bytes(kept)
    return root


def shown(said: str) -> list[str]:
    """The words of the command that a warning of `run` ends with."""
    line = next(line for line in said.splitlines() if line.startswith("warning:"))
    return shlex.split(line[line.index("r2s2r ") :])[1:]


def told(words: Sequence[str]) -> str:
    """The stage's command that `run` with these words shows for doing again."""
    result = invoke("run", *words, "--until", "execute", "--dry-run")
    assert result.exit_code == 0, result.stderr
    return " ".join(shown(result.stderr))


def test_what_was_run_is_run_again(older: Path) -> None:
    """Policies, repeats and camera as they were recorded, the port that is named now; of its iteration, and it asks."""
    camera = read_header(older / "iterations" / "001" / "50-execute.h5").provenance.settings["flags"]["camera"]
    assert told(["--iteration", "1", *ROBOT]) == (
        f"execute straight turn-counterclockwise --port socket://nowhere:1 --camera {camera} --repeats 2 "
        "--iteration 1 --force"
    )


def test_what_is_typed_takes_the_place_of_what_was_recorded(older: Path) -> None:
    """Each option by itself."""
    words = told(["--iteration", "1", *ROBOT, "--policy", "forward", "--repeats", "4", "--camera", "open3d"])
    assert words == "execute forward --port socket://nowhere:1 --camera open3d --repeats 4 --iteration 1 --force"


def test_policies_that_the_plan_has_lost_are_not_asked_for(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The long ones of today take their place."""

    def lost(text: str, command: str) -> None:
        raise UsageError("there is no such policy", where=text, expected="others", received=text, hint="r2s2r status")

    monkeypatch.setattr("r2s2r_cli.commands.simulate_inputs.read_policies", lost)
    assert told(["--iteration", "2", *ROBOT]).startswith("execute --port")


def test_it_is_shown_for_where_it_is_pasted(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From outside of the project the command names it."""
    monkeypatch.chdir(older.parent)
    words = shlex.split(told(["--project", "project", "--iteration", "1", *ROBOT]))
    assert words[-2:] == ["--project", "project"]


def test_a_recording_that_was_cut_off_keeps_its_policies(project: Path, calls: Calls) -> None:
    """Not the random ones that `run` records by itself."""
    put(project, "10-record.h5", builders.recording(), "record", report=CUT_OFF, settings={"flags": FLAGS})
    put(project, "20-estimate.h5", builders.estimate(), "estimate")
    result = invoke("run", *ROBOT, "--until", "plan")
    assert " ".join(shown(result.stderr)) == (
        "record gait.toml --port socket://nowhere:1 --camera realsense --repeats 3 --iteration 1 --force"
    )


@pytest.mark.parametrize("until", ["plan", "execute"])
def test_nobody_to_ask_is_said_before_anything_is_computed(
    estimated: Path, calls: Calls, monkeypatch: pytest.MonkeyPatch, until: str
) -> None:
    """Without a terminal and --yes no stage begins where the robot would execute; where it would not, all do."""
    words = ["run", "--port", "socket://nowhere:1", "--until", until]
    monkeypatch.setattr("sys.argv", ["r2s2r", *words])
    result = invoke(*words)
    assert (result.exit_code, bool(calls)) == ((0, True) if until == "plan" else (2, False))
    assert (f"hint: r2s2r {shlex.join(words)} --yes" in result.stderr) == (until == "execute")


def test_nobody_is_asked_where_the_robot_has_moved(older: Path, calls: Calls) -> None:
    """Runs that are there stay, and nothing else needs an answer; nor does a dry run."""
    assert invoke("run", "--port", "socket://nowhere:1", "--iteration", "1").exit_code == 0
    (older / "iterations/002/50-execute.h5").unlink()
    assert invoke("run", "--port", "socket://nowhere:1", "--iteration", "2", "--dry-run").exit_code == 0
    assert invoke("run", "--port", "socket://nowhere:1", "--iteration", "2").exit_code == 2

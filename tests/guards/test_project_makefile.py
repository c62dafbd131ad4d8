"""The Makefile of a project: order of the stages, no loop, and raw runs are safe from make."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.guards.listing import ROOT

TEMPLATE = ROOT / "r2s2r_cli" / "templates" / "project.mk"
RECORD, ESTIMATE = "iterations/001/10-record.h5", "iterations/001/20-estimate.h5"
IDENTIFY = "iterations/001/30-identify.h5"

# Stands in for r2s2r: writes the artifact of the stage that make asks for, logs the call, fails where told to.
STAND_IN = """#!/bin/sh
echo "$@" >> calls.txt
case "$1" in import|record) f=10-record.h5 ;; estimate) f=20-estimate.h5 ;;
identify) f=30-identify.h5 ;; plan) f=40-plan.h5 ;; execute) f=50-execute.h5 ;; compare) f=60-compare.h5 ;;
*) exit 0 ;; esac
[ "$4$5" = "--ofexecute" ] && f=51-estimate.h5
n=iterations/$(printf '%03d' "$(expr $3 + 0)")
mkdir -p $n && echo "$1" > $n/$f
[ "$1" != "$FAIL_IN" ]
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with what make looks at, in a path with a space."""
    if shutil.which("make") is None:
        pytest.skip("there is no make on this machine")
    folder = tmp_path / "my project"
    folder.mkdir()
    shutil.copy(TEMPLATE, folder / "Makefile")
    for file in ("project.toml", "robot.toml", "a.csv"):
        (folder / file).write_text("")
    (folder / "r2s2r").write_text(STAND_IN)
    (folder / "r2s2r").chmod(0o755)
    return folder


def make(project: Path, *arguments: str, fail_in: str = "") -> subprocess.CompletedProcess[str]:
    """Run make there, with the stand-in as r2s2r."""
    keep = {key: text for key, text in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    environment = {**keep, "R2S2R": str(project / "r2s2r"), "FAIL_IN": fail_in}
    return subprocess.run(
        ["make", *arguments], cwd=project, env=environment, capture_output=True, text=True, check=False
    )


def calls(project: Path) -> list[str]:
    """The calls of r2s2r so far."""
    log = project / "calls.txt"
    return log.read_text().splitlines() if log.exists() else []


def test_stages_run_in_order_and_then_rest(project: Path) -> None:
    """`make iterate` imports, estimates, identifies, plans and compares; a second call has nothing to do."""
    assert make(project, "iterate", "SOURCE=a.csv").returncode == 0
    rest = [f"{stage} --iteration 001" for stage in ("estimate", "identify", "plan", "compare")]
    assert calls(project) == ["import --iteration 001 a.csv", *rest]
    assert make(project, "-q", "iterate", "SOURCE=a.csv").returncode == 0


def test_a_changed_robot_runs_what_depends_on_it(project: Path) -> None:
    """After an edit of robot.toml the estimate is asked for again; without SOURCE nothing is imported again."""
    make(project, "iterate", "SOURCE=a.csv")
    for path, seconds in ((RECORD, 1000), (ESTIMATE, 2000), (IDENTIFY, 2000), ("robot.toml", 3000)):
        os.utime(project / path, (seconds, seconds))
    os.utime(project / "project.toml", (0, 0))
    assert make(project, "iterate").returncode == 0
    assert calls(project)[5:7] == ["estimate --iteration 001", "identify --iteration 001"]


def test_what_stands_beside_the_runs_counts_too(project: Path) -> None:
    """A new sidecar is imported, a new floor compared with, and what an earlier iteration learned anew goes into the
    next one: `status` would call all of these stale."""
    (project / "a.toml").write_text("")
    make(project, "iterate", "SOURCE=a.csv")
    (project / "floor.h5").write_text("")
    os.utime(project / "floor.h5", (4e9, 4e9))
    assert make(project, "iterate", "SOURCE=a.csv").returncode == 0
    assert calls(project)[5:] == ["compare --iteration 001"]
    os.utime(project / "floor.h5", (0, 0))
    os.utime(project / "a.toml", (4e9, 4e9))
    assert make(project, "-q", "iterate").returncode == 0, "without the log there is nothing to import again"
    assert make(project, "iterate", "SOURCE=a.csv").returncode == 0
    assert calls(project)[6] == "import --iteration 001 a.csv"
    os.utime(project / "a.toml", (0, 0))
    make(project, "iterate", "ITER=2")
    assert make(project, "-q", "iterate", "ITER=2").returncode == 0
    os.utime(project / IDENTIFY, (5e9, 5e9))
    count = len(calls(project))
    assert make(project, "iterate", "ITER=2").returncode == 0
    assert calls(project)[count:] == ["identify --iteration 2", "plan --iteration 2"]


def test_an_iteration_without_runs_learns_from_the_one_before(project: Path) -> None:
    """Without a log of its own iteration 2 only identifies and plans, and again when the estimate before it is new;
    iteration 3 learns from the same, there being none in between."""
    make(project, "iterate", "SOURCE=a.csv")
    assert make(project, "iterate", "ITER=002").returncode == 0
    assert calls(project)[5:] == ["identify --iteration 002", "plan --iteration 002"]
    assert make(project, "iterate", "ITER=003").returncode == 0
    assert calls(project)[7:] == ["identify --iteration 003", "plan --iteration 003"]
    assert make(project, "-q", "iterate", "ITER=002").returncode == 0
    os.utime(project / ESTIMATE, (4e9, 4e9))
    assert make(project, "-q", "iterate", "ITER=002").returncode == 1


def test_nothing_to_import_is_said_in_words(project: Path) -> None:
    """Without a recording and without SOURCE make stops with a line that can be pasted."""
    done = make(project, "iterate")
    assert done.returncode == 2
    assert 'hint: make iterate ITER=001 SOURCE="a.csv b.csv"' in done.stderr
    assert calls(project) == []


def test_a_robot_is_recorded_once(project: Path) -> None:
    """With PORT the runs come from the robot, and however old they are, a second call does not move it again."""
    assert make(project, "iterate", "PORT=/dev/ttyUSB0", "RUNS=gait.toml").returncode == 0
    assert calls(project)[0] == "record --iteration 001 gait.toml --port /dev/ttyUSB0"
    os.utime(project / "robot.toml", (4e9, 4e9))
    os.utime(project / RECORD, (0, 0))
    make(project, "iterate", "PORT=/dev/ttyUSB0")
    assert [call for call in calls(project)[1:] if call.startswith("record")] == []


def test_a_robot_executes_the_plan_once_and_the_next_iteration_learns_from_it(project: Path) -> None:
    """With PORT the whole chain; a new plan moves no robot that has done its runs, new runs are estimated and compared,
    and iteration 2 records nothing, learns from both estimates, and again when the executed one is new."""
    robot = ("PORT=/dev/ttyUSB0", "CAMERA=realsense", "EXECUTE_OPTIONS=--yes", "POLICIES=straight")
    assert make(project, "iterate", *robot).returncode == 0
    assert calls(project) == [
        "record --iteration 001 --random 15 --repeats 3 --port /dev/ttyUSB0 --camera realsense",
        "estimate --iteration 001", "identify --iteration 001", "plan --iteration 001",
        "execute --iteration 001 straight --port /dev/ttyUSB0 --camera realsense --yes",
        "estimate --iteration 001 --of execute", "compare --iteration 001",
    ]  # fmt: skip
    folder = project / "iterations" / "001"
    os.utime(folder / "40-plan.h5", (4e9, 4e9))
    assert make(project, "-q", "iterate", *robot).returncode == 0
    os.utime(folder / "50-execute.h5", (4e9, 4e9))
    assert make(project, "iterate").returncode == 0, "the runs are there: no robot is needed to look at them"
    assert calls(project)[7:] == ["estimate --iteration 001 --of execute", "compare --iteration 001"]
    assert make(project, "iterate", "ITER=2", *robot).returncode == 0
    assert calls(project)[9:] == [
        "identify --iteration 2", "plan --iteration 2",
        "execute --iteration 2 straight --port /dev/ttyUSB0 --camera realsense --yes",
        "estimate --iteration 2 --of execute", "compare --iteration 2",
    ]  # fmt: skip
    os.utime(folder / "51-estimate.h5", (5e9, 5e9))
    assert make(project, "-q", "iterate", "ITER=002").returncode == 1


def test_make_never_deletes_a_recording(project: Path) -> None:
    """A command that fails after it wrote: make removes a computed artifact, and leaves raw runs alone."""
    assert make(project, "iterate", "SOURCE=a.csv", fail_in="import").returncode == 2
    assert (project / RECORD).exists()
    assert make(project, "iterate", fail_in="estimate").returncode == 2
    assert not (project / ESTIMATE).exists()
    assert (project / RECORD).exists()

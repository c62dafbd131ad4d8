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
identify) f=30-identify.h5 ;; *) exit 0 ;; esac
mkdir -p iterations/$3 && echo "$1" > iterations/$3/$f
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
    """`make iterate` imports, estimates, then identifies; a second call has nothing to do."""
    assert make(project, "iterate", "SOURCE=a.csv").returncode == 0
    assert calls(project) == ["import --iteration 001 a.csv", "estimate --iteration 001", "identify --iteration 001"]
    assert make(project, "-q", "iterate", "SOURCE=a.csv").returncode == 0


def test_a_changed_robot_runs_what_depends_on_it(project: Path) -> None:
    """After an edit of robot.toml the estimate is asked for again; without SOURCE nothing is imported again."""
    make(project, "iterate", "SOURCE=a.csv")
    for path, seconds in ((RECORD, 1000), (ESTIMATE, 2000), (IDENTIFY, 2000), ("robot.toml", 3000)):
        os.utime(project / path, (seconds, seconds))
    os.utime(project / "project.toml", (0, 0))
    assert make(project, "iterate").returncode == 0
    assert calls(project)[3:] == ["estimate --iteration 001", "identify --iteration 001"]


def test_an_iteration_without_runs_learns_from_the_one_before(project: Path) -> None:
    """Without a log of its own iteration 2 only identifies, and again when the estimate before it is a new one."""
    make(project, "iterate", "SOURCE=a.csv")
    assert make(project, "iterate", "ITER=002").returncode == 0
    assert calls(project)[3:] == ["identify --iteration 002"]
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


def test_make_never_deletes_a_recording(project: Path) -> None:
    """A command that fails after it wrote: make removes a computed artifact, and leaves raw runs alone."""
    assert make(project, "iterate", "SOURCE=a.csv", fail_in="import").returncode == 2
    assert (project / RECORD).exists()
    assert make(project, "iterate", fail_in="estimate").returncode == 2
    assert not (project / ESTIMATE).exists()
    assert (project / RECORD).exists()

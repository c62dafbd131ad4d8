"""Ctrl-C in the long stages of `run`, then the same command again: the artifacts are those of a run in one go. And a
SIGINT that `run` gets alone."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import tomlkit

from r2s2r_cli.store.header import read_header
from tests.commands.conftest import invoke

SMALL = {
    "identify.free": ["friction"], "identify.starts": 1, "identify.profiles": 0, "identify.max_iterations": 2,
    "identify.window": 2, "identify.step_s": 0.002, "identify.train_share": 1.0,
    "plan.depth": 2, "plan.draws": 2, "plan.starts": 1, "plan.candidates": 3, "plan.kept": 2, "plan.cycles": 2,
    "plan.most_changed": 2, "plan.step_s": 0.002,
}  # fmt: skip
"""Settings of a loop of seconds."""
STAGES = ("identify", "plan")
"""Those up to the plan that keep checkpoints; an estimate is interrupted in test_interrupt.py."""
ARTIFACTS = ("30-identify.h5", "40-plan.h5")
COMMAND = [sys.executable, "-m", "r2s2r_cli", "run", "--until", "plan", "--no-draw"]
LIMIT_S = 400.0
ROWS = 60
"""Of the log: three target intervals."""


def interrupted(project: Path, stage: str) -> int:
    """Exit code of a run that gets Ctrl-C, with all its processes, at the first checkpoint of this stage."""
    with subprocess.Popen(
        COMMAND, cwd=project, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        # A suite in the background ignores SIGINT, and so would what it starts.
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as child:  # fmt: skip
        assert child.stderr is not None
        for line in child.stderr:
            if f"r2s2r {stage} " in line:
                begun(project, stage)
                os.killpg(child.pid, signal.SIGINT)
                break
        said = child.stderr.read()
        code = child.wait()
    assert "Traceback" not in said
    return code


def begun(project: Path, stage: str) -> None:
    """Wait until the stage is at work."""
    end = time.monotonic() + LIMIT_S
    while not list(project.rglob(f"*-{stage}.partial")):
        assert time.monotonic() < end, f"{stage} kept no checkpoint"
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there are no groups of processes to interrupt")
def test_an_interrupted_loop_goes_on_to_the_same(project: Path, tmp_path: Path) -> None:
    """Stopped in identify and in plan, then run to its end, beside one that nobody stopped: the same hashes."""
    settings = tomlkit.parse((project / "project.toml").read_text("utf-8"))
    for name, value in SMALL.items():
        section, key = name.split(".")
        settings[section][key] = value
    (project / "project.toml").write_text(tomlkit.dumps(settings), "utf-8")
    log = project / "sample.csv"
    log.write_text("".join(log.read_text("utf-8").splitlines(keepends=True)[:ROWS]), "utf-8")
    for words in (("import", "sample.csv"), ("estimate", "--no-draw")):
        assert invoke(*words).exit_code == 0
    whole = Path(shutil.copytree(project, tmp_path / "whole"))
    assert [interrupted(project, stage) for stage in STAGES] == [130] * len(STAGES)
    hashes = []
    for folder in (project, whole):
        done = subprocess.run(COMMAND, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        headers = [read_header(folder / "iterations" / "001" / name) for name in ARTIFACTS]
        hashes.append([one.content_sha256 for one in headers])
    assert hashes[0] == hashes[1]


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGINT for one process")
def test_a_kill_of_run_alone_ends_its_stage(project: Path) -> None:
    """`r2s2r run ... & kill -INT $!` of a script: the shell began both processes with SIGINT ignored, and only the one
    gets it. The stage ends with it, and none is begun after it."""
    with subprocess.Popen(
        [*COMMAND[:4], "sample.csv", "--until", "identify", "--no-draw"], cwd=project, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    ) as child:  # fmt: skip
        assert child.stderr is not None
        for line in child.stderr:
            if "[2/3] r2s2r estimate" in line:
                time.sleep(0.3)  # until its process is there; without one `run` has nothing to pass on, and ends too
                child.send_signal(signal.SIGINT)
                break
        said = child.stderr.read()
    assert child.returncode == 130, said
    assert "interrupted: " in said and "[3/3]" not in said and "Traceback" not in said

"""Ctrl-C in every computing stage of `run`, then the same command again: the artifacts are those of a run in one go."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from r2s2r_cli.store.header import read_header

SMALL = """
[identify]
starts = 1
profiles = 0
max_iterations = 2

[plan]
depth = 2
draws = 2
starts = 1
candidates = 3
kept = 2
cycles = 2
most_changed = 2
"""
ARTIFACTS = ("10-record.h5", "20-estimate.h5", "30-identify.h5", "40-plan.h5")
COMMAND = [sys.executable, "-m", "r2s2r_cli", "run", "sample.csv", "--until", "plan", "--no-draw"]


def begun(project: Path) -> subprocess.Popen[str]:
    """The command, in a group of processes of its own that hears Ctrl-C."""
    return subprocess.Popen(
        COMMAND, cwd=project, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


def interrupted(project: Path, stage: str) -> int:
    """Ctrl-C a moment after this stage has begun; the exit code."""
    with begun(project) as child:
        assert child.stderr is not None
        for line in child.stderr:
            if f"r2s2r {stage} " in line:
                time.sleep(1.5)
                os.killpg(child.pid, signal.SIGINT)
                break
        child.stderr.read()
        return child.wait()


def hashes(project: Path) -> list[str]:
    """Of the content of every artifact."""
    return [read_header(project / "iterations" / "001" / name).content_sha256 for name in ARTIFACTS]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there are no groups of processes to interrupt")
def test_an_interrupted_loop_goes_on_to_the_same(project: Path, tmp_path: Path) -> None:
    """Stopped in estimate, identify and plan, then run to its end."""
    settings = project / "project.toml"
    text = settings.read_text()
    for table in SMALL.strip().split("\n\n"):
        head, _, body = table.partition("\n")
        keys = [line.split(" = ")[0] for line in body.splitlines()]
        before, _, after = text.partition(head + "\n")
        own, bracket, rest = after.partition("\n[")
        kept = "\n".join(line for line in own.splitlines() if line.split(" = ")[0] not in keys)
        text = f"{before}{head}\n{body}\n{kept}{bracket}{rest}"
    settings.write_text(text)
    whole = tmp_path / "whole"
    shutil.copytree(project, whole)
    for stage in ("estimate", "identify", "plan"):
        assert interrupted(project, stage) in (130, 0)
    for folder in (project, whole):
        done = subprocess.run(COMMAND, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert hashes(project) == hashes(whole)

"""Ctrl-C at any moment: exit code 130 or done, no traceback, nothing half-written."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.commands.interrupts import whole_items
from r2s2r_cli.store.header import read_header
from tests.commands.conftest import invoke
from tests.support.soak import drawn

ESTIMATE = "iterations/001/20-estimate.h5"
START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits "ignore"
sys.argv = ["r2s2r", *sys.argv[1:]]
from r2s2r_cli.__main__ import main
print("started", file=sys.stderr, flush=True)
main()
"""


SAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sample-project" / "project"
STAGES = [
    (("estimate", "--iteration", "1"), ESTIMATE),
    (("simulate", "--random", "3", "--iteration", "1"), "iterations/001/simulation.h5"),
    (("floor",), "floor.h5"),
]
"""Computing stages that begin anew, and what they write; those that go on have tests of their own."""


def interrupted(project: Path, delay_s: float, *words: str) -> tuple[int, str]:
    """Exit code and stderr of a command (default: an estimate) that gets SIGINT after `delay_s`."""
    words = (*(words or ("estimate",)), "--force", "--quiet")
    child = subprocess.Popen(
        [sys.executable, "-c", START, *words], cwd=project, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    if child.stderr is None:
        raise RuntimeError("the child has no stderr")
    child.stderr.readline()
    time.sleep(delay_s)
    child.send_signal(signal.SIGINT)
    _, stderr = child.communicate(timeout=180)
    return child.returncode, stderr


def check(project: Path, delays_s: list[float]) -> None:
    """Interrupt at each moment; the artifact is whole each time, and at least one run was interrupted."""
    codes = []
    for delay in delays_s:
        code, stderr = interrupted(project, delay)
        codes.append(code)
        assert code in (0, 130), (delay, stderr)
        assert "Traceback" not in stderr
        assert not list(project.rglob("*.partial"))
    assert 130 in codes
    assert invoke("validate", ESTIMATE).exit_code == 0


def test_an_interrupt_waits_for_the_item_in_the_making() -> None:
    """SIGINT while an item is made is raised once it is there; no further one is begun."""
    made = []

    def items() -> Iterator[int]:
        for i in range(3):
            if i == 1:
                os.kill(os.getpid(), signal.SIGINT)
            made.append(i)
            yield i

    taken = []
    with pytest.raises(KeyboardInterrupt):
        for item in whole_items(items()):
            taken.append(item)
    assert (made, taken) == ([0, 1], [0])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_leaves_everything_whole(estimated: Path) -> None:
    """A few moments, from the imports of the program to the drawing."""
    check(estimated, [0.02, 0.1, 0.4, 0.9])


@pytest.mark.slow
def test_ctrl_c_at_many_moments(estimated: Path) -> None:
    """A dozen moments over the whole command, in a soak test forty."""
    check(estimated, [0.02 + spread * 2.0 for spread in np.linspace(0.0, 1.0, drawn(12, 40))])


@pytest.mark.slow
@pytest.mark.parametrize(("words", "target"), STAGES, ids=[words[0] for words, _ in STAGES])
def test_a_stage_that_was_interrupted_gives_the_same(
    words: tuple[str, ...], target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At four moments between the imports and the end: what was there is there, to the byte, or the stage was done;
    run again it gives the hash that it has when nobody interrupts it."""
    project = tmp_path / "sample"
    if words[0] == "estimate":  # pictures take minutes; a log does as well
        assert invoke("init", str(project), "--sample").exit_code == 0
        assert invoke("import", str(project / "sample.csv"), "--project", str(project)).exit_code == 0
    else:
        shutil.copytree(SAMPLE, project)
    monkeypatch.chdir(project)
    begun = time.monotonic()
    assert invoke(*words, "--force", "--no-draw").exit_code == 0
    whole = time.monotonic() - begun
    wanted = read_header(project / target).content_sha256
    codes = []
    for share in (0.1, 0.4, 0.7, 0.95):
        before = (project / target).read_bytes()
        code, stderr = interrupted(project, share * whole, *words, "--no-draw")
        codes.append(code)
        assert code in (0, 130) and "Traceback" not in stderr, stderr
        assert not list(project.rglob("*.partial"))
        assert code == 0 or (project / target).read_bytes() == before
    assert 130 in codes
    assert invoke(*words, "--force", "--no-draw").exit_code == 0
    assert read_header(project / target).content_sha256 == wanted


def test_an_interrupt_that_a_finaliser_swallows_comes_again() -> None:
    """Python prints an exception of a weak reference's callback and goes on; ours ends the command, without a word."""
    program = """
import signal, sys, time, weakref
from r2s2r_cli.__main__ import again
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits "ignore"
sys.unraisablehook = again(sys.unraisablehook)
class Thing: pass
def swallowed(_): raise KeyboardInterrupt
thing = Thing()
kept = weakref.ref(thing, swallowed)
try:
    del thing
    time.sleep(10)
except KeyboardInterrupt:
    print("came again")
"""
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=180, check=True)
    assert (found.stdout, found.stderr) == ("came again\n", "")

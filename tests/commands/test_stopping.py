"""SIGTERM and SIGHUP are an interrupt like Ctrl-C, a stop that is told twice is one, and a job behind `&` hears it."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import signal, sys, time
from r2s2r_cli.commands import COMMANDS
from r2s2r_cli.commands.interrupts import whole_items

def items():
    print("at work", file=sys.stderr, flush=True)
    time.sleep(1.0)  # goes on after a signal whose handler raises nothing
    print("item whole", file=sys.stderr, flush=True)
    yield 1

def status() -> None:
    try:
        for _ in whole_items(items()):
            pass
    except KeyboardInterrupt:
        print("ending", file=sys.stderr, flush=True)
        time.sleep(0.5)
        print("ended", file=sys.stderr, flush=True)
        raise

COMMANDS["status"] = status
sys.argv = ["r2s2r", "status"]
from r2s2r_cli.__main__ import main
main()
"""
"""A command whose work must not be interrupted in its midst, nor its end by a second stop."""


@pytest.mark.parametrize("first", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize("deaf", [False, True], ids=["foreground", "background"])
def test_a_kill_is_an_interrupt_and_counts_once(tmp_path: Path, first: signal.Signals, deaf: bool) -> None:
    """The item is finished, the end is not disturbed by the SIGTERM that comes after either signal, and the command
    leaves with 130 and its line; so it does where a shell began it with SIGINT ignored."""
    begun = signal.SIG_IGN if deaf else signal.SIG_DFL

    def prepare() -> None:
        signal.signal(signal.SIGINT, begun)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # these tests may have been begun with nohup

    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=prepare,
    ) as child:  # fmt: skip
        assert child.stderr is not None
        assert child.stderr.readline() == "at work\n"
        child.send_signal(first)
        assert child.stderr.readline() == "item whole\n"
        assert child.stderr.readline() == "ending\n"
        child.send_signal(signal.SIGTERM)
        said = child.stderr.read()
    assert (child.returncode, said) == (130, "ended\ninterrupted: nothing is half-written; run the command again\n")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_kill_that_is_ignored_stays_so(tmp_path: Path, number: signal.Signals) -> None:
    """Whoever starts a command with SIGTERM ignored, or with nohup, wants that."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_IGN),
    ) as child:  # fmt: skip
        assert child.stderr is not None
        child.stderr.readline()
        child.send_signal(number)
        said = child.stderr.read()
    assert (child.returncode, said) == (0, "item whole\n")

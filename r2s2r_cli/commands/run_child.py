"""The process of one stage of `run`: whoever stops `run` stops it too; no robot is left to a process alone."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Any

from r2s2r_cli.hardware.signals import ENDING
from r2s2r_cli.stopping import STOP

STOPPED = (signal.SIGINT, *ENDING)
"""Signals by which somebody stops a command; a child that another one ended has failed."""
_KEYS = ("SIGQUIT", "SIGTSTP")
"""Those that a stage that only computes answers as every program does: it dies, or is frozen and goes on."""


def ended(words: Sequence[str], *, robot: bool, **streams: Any) -> tuple[int, bool]:
    """Exit code of one command in a process of its own, so that its memory is given back; and whether somebody stopped
    it. robot: it moves one. streams: of the process, as `Popen` takes them."""
    with _passing_on([number for number in STOPPED if robot or number.name not in _KEYS]) as passing:
        with subprocess.Popen([sys.executable, "-m", "r2s2r_cli", *words], **streams) as child:
            passing.to(child)
            code = child.wait()  # it stops what it does in its own way
        return code, passing.told


class _Passing:
    """Tells a child to end, once it is known."""

    def __init__(self) -> None:
        self.told = False
        self._child: subprocess.Popen[bytes] | None = None

    def to(self, child: subprocess.Popen[bytes]) -> None:
        """The child; it is told at once where a signal was faster than its start."""
        self._child = child
        if self.told:
            self._tell(child)

    def heard(self, *_: int | FrameType | None) -> None:
        """A signal."""
        self.told = STOP.told = True
        if self._child is not None:
            self._tell(self._child)

    def _tell(self, child: subprocess.Popen[bytes]) -> None:
        # Whatever came, and whether or not the child had it too (a terminal tells both, `kill` and a supervisor only
        # us): a command stops on the first signal and ignores a SIGTERM after it. One that Ctrl-Z froze before it got
        # there must go on to end.
        child.send_signal(signal.SIGTERM)
        if hasattr(signal, "SIGCONT"):
            child.send_signal(signal.SIGCONT)


@contextlib.contextmanager
def _passing_on(numbers: Sequence[signal.Signals]) -> Iterator[_Passing]:
    """While inside these signals only tell the child. What is ignored stays ignored (nohup); without effect in a thread
    that is not the main one."""
    passing = _Passing()
    before: dict[signal.Signals, Any] = {}
    try:
        if threading.current_thread() is threading.main_thread():
            for number in numbers:
                if signal.getsignal(number) is not signal.SIG_IGN:
                    before[number] = signal.signal(number, passing.heard)
        yield passing
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

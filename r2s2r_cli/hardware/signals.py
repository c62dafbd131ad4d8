"""Signals that end a run as Ctrl-C does: as an exception, so that every `with` is left and the motors stop.

SIGTERM and SIGHUP (a polite kill, a closed terminal), and the two keys that would leave a robot with its motors on:
Ctrl-Z (SIGTSTP), which freezes whoever drives it, and Ctrl-backslash (SIGQUIT), which kills without a word.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

from r2s2r_cli.stopping import POLITE, STOP

ENDING = (*POLITE, *(getattr(signal, name) for name in ("SIGQUIT", "SIGTSTP") if hasattr(signal, name)))
"""Those that this system has."""


class Heard:
    """What came of the signals so far. told: one has ended the run, or Ctrl-C has. late: one came after it."""

    def __init__(self) -> None:
        self.told = self.late = self._stands = False
        self._before: dict[int, Any] = {}

    def standing(self) -> None:
        """The robot stands, and files are written, which an exception out of the blue would spoil: from here on these
        signals wait for the end of the context."""
        self._stands = True

    def listen(self) -> None:
        """Set the handlers."""
        for number in ENDING:
            self._before[number] = signal.signal(number, self._end)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # whoever has another one keeps it
            self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._press)

    def restore(self) -> None:
        """The handlers that were there."""
        while self._before:
            signal.signal(*self._before.popitem())

    def _end(self, number: int, _: FrameType | None) -> None:
        # A terminal tells all of its processes, `timeout` and systemd may, and `r2s2r run` passes on what it hears:
        # only the first one ends the run, the next would fall into the midst of its end.
        if self.told or self._stands:
            self.late = True
            return
        self.told = STOP.told = True
        raise KeyboardInterrupt(signal.Signals(number).name)

    def _press(self, number: int, frame: FrameType | None) -> None:
        self.told = STOP.told = True
        signal.default_int_handler(number, frame)


@contextlib.contextmanager
def interrupting_signals() -> Iterator[Heard]:
    """While inside, the first of these signals raises KeyboardInterrupt in the main thread; Ctrl-C always does.

    Without effect in another thread, which may not set handlers. Nobody can catch SIGKILL and SIGSTOP: after them only
    a device with a watchdog stops.
    """
    heard = Heard()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return
    heard.listen()
    try:
        yield heard
    finally:
        heard.restore()
    if heard.late and not heard.told:
        raise KeyboardInterrupt

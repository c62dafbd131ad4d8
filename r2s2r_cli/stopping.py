"""A polite kill is Ctrl-C: SIGTERM, and SIGHUP when a terminal is closed or a connection lost, end every command as
SIGINT does, with its message, its checkpoint and its code.

One stop is often told several times: a terminal and `timeout` tell all of its processes, and `r2s2r run` passes on what
it hears. The first one ends the command; a polite kill after it would fall into its end and is not heard.
Who presses Ctrl-C twice insists, and is heard.
"""

from __future__ import annotations

import os
import signal

POLITE = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Those that this system has."""


class Stop:
    """What came so far. told: somebody has stopped this command."""

    def __init__(self) -> None:
        self.told = False
        self._numbers = -1

    def listen(self) -> None:
        """Set the handlers of this process. Ctrl-C is heard even where the process began with it ignored: a shell
        without job control ignores it for what stands before `&`, which is meant for the keys of its terminal, but
        whoever sends SIGINT to such a process (a supervisor, a script) means it, and it may be driving a robot. What is
        stopped by a key that was meant for others goes on where it was. Of the polite kills nobody's default is to
        ignore one: where it is (`nohup`), that was wanted."""
        self.told = False
        signal.signal(signal.SIGINT, signal.default_int_handler)
        heard = [number for number in POLITE if signal.getsignal(number) is not signal.SIG_IGN]
        if not heard:
            return
        for number in heard:
            signal.signal(number, self._end)
        if self._numbers < 0 and os.name != "nt":
            # Python writes the number of every signal there, whoever handles it: many do, for a while.
            self._numbers, written = os.pipe()
            for end in (self._numbers, written):
                os.set_blocking(end, False)
            signal.set_wakeup_fd(written, warn_on_full_buffer=False)

    def _end(self, *_: object) -> None:
        if not self.told and signal.SIGINT not in self._came():
            signal.raise_signal(signal.SIGINT)  # its handler of this moment knows whether an exception must wait
        self.told = True

    def _came(self) -> bytes:
        """The numbers of the signals since the last look."""
        try:
            return os.read(self._numbers, 1 << 16) if self._numbers >= 0 else b""
        except BlockingIOError:
            return b""


STOP = Stop()
"""Of this process."""

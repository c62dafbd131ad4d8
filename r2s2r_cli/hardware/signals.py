"""SIGTERM and SIGHUP end a run as Ctrl-C does: as an exception, so that every `with` is left and the motors stop."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt(signal.Signals(number).name)


@contextlib.contextmanager
def interrupting_signals() -> Iterator[None]:
    """While inside, a polite kill or a closed terminal raises KeyboardInterrupt in the main thread.

    Without effect in another thread, which may not set handlers. Nobody can catch SIGKILL: after it only a device
    with a watchdog stops.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), _interrupt) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)

"""A robot without a watchdog stands still: it is told to stop until all that it sent is on the disk."""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import Self

from r2s2r_cli.devices.link import STOP_PAUSE, STOPS, RobotLink


class Still:
    """Says stop again and again, from `begin` until it is left, by a thread of its own; at once and once where the
    robot stops by itself, or in lock-step, whose time stands still.

    A disk that stands still, or pictures that are still to be encoded, must not keep a lost stop from being repeated.
    """

    def __init__(self, link: RobotLink) -> None:
        self._link = link
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """All motors off, now. Never raises."""
        self._link.stop()
        facts = self._link.facts
        if self._thread is None and not facts.stops_by_itself and not facts.lock_step:
            self._thread = threading.Thread(target=self._again, name="record-still", daemon=True)
            self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _again(self) -> None:
        said = 0
        while said < STOPS or not self._over.is_set():
            self._link.stop()
            said += 1
            time.sleep(STOP_PAUSE)

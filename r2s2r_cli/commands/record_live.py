"""What a person sees while the robot moves: progress, cable lengths, health of the link; and the emergency stop key."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from r2s2r_cli.console import LINE_S, NO_PROGRESS, Console

if TYPE_CHECKING:
    from r2s2r_cli.stages.record import Now

STOP_KEY = " "
_REFRESH_HZ = 4.0
_BAR = 24


class Live:
    """The latest state of the run, drawn by a thread of its own: the control loop only leaves it here.

    targets: of each run.
    """

    def __init__(self, targets: Sequence[int]) -> None:
        self._targets = sum(targets)
        self._now: Now | None = None
        self._run = ""
        self._before = 0
        self._began = time.monotonic()

    def watch(self, now: Now) -> None:
        """Called by the control loop."""
        if now.run != self._run:
            if self._now is not None:
                self._before += self._now.targets
            self._run = now.run
        self._now = now

    def left(self) -> float | None:
        """Time left [s], by the targets so far; None before the third."""
        done = self._before + (self._now.target - 1 if self._now else 0)
        return None if done < 2 else (time.monotonic() - self._began) / done * max(0, self._targets - done)

    def lines(self) -> list[str]:
        """What is shown, a line each."""
        now = self._now
        if now is None:
            return ["waiting for the first sample"]
        done = self._before + now.target - 1
        left = self.left()
        eta = "" if left is None else f", about {left:.0f} s left"
        rate = "" if now.rate is None else f"{now.rate:.1f} Hz"
        camera = "" if now.frames is None else f", camera {now.frames} frames, {now.frames_lost} lost"
        link = now.link
        latency = "" if link.latency_median is None else f", {1e3 * link.latency_median:.1f} ms"
        health = f"lost {_count(link.lost)}, corrupt {link.corrupt}{latency}"
        there = f"target {now.target} of {now.targets}, {now.t:.1f} s"
        shown = [
            f"run {now.run}: {there}; {done} of {self._targets} in all{eta}",
            f"link {rate}, {link.received} samples, {health}{camera}",
        ]
        for i, (length, position, aim, there) in enumerate(
            zip(now.length, now.position, now.aim, now.done, strict=True)
        ):
            shown.append(f"cable {i} {1e3 * length:6.1f} mm {_bar(position, aim)} {'done' if there else ''}".rstrip())
        return [*shown, *["space: emergency stop"] * hears_keys()]


def _count(value: int | None) -> str:
    return "?" if value is None else str(value)


def _bar(position: float, aim: float) -> str:
    """A cable between short and long, with its target as |."""
    cells = ["-"] * _BAR
    for place, mark in ((aim, "|"), (position, "o")):
        if place == place:  # not NaN
            cells[min(_BAR - 1, max(0, round(place * (_BAR - 1))))] = mark
    return f"[{''.join(cells)}]"


@contextlib.contextmanager
def shown(live: Live, console: Console) -> Iterator[None]:
    """Draw it on stderr while the context lasts; silent with --quiet, or where R2S2R_NO_PROGRESS is set.

    Where stderr is no terminal a line every LINE_S seconds says how far the runs are, as other long work does.
    """
    if console.quiet or os.environ.get(NO_PROGRESS):
        yield
        return
    if not sys.stderr.isatty():
        with _spoken(live, console):
            yield
        return
    from rich.console import Console as RichConsole
    from rich.live import Live as RichLive
    from rich.text import Text

    def picture() -> Text:
        return Text("\n".join(live.lines()))

    drawn = RichLive(
        get_renderable=picture, console=RichConsole(stderr=True), refresh_per_second=_REFRESH_HZ, transient=True
    )
    drawn.start()
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # the terminal was closed, which ends the run: what there is must be sealed
            drawn.stop()


@contextlib.contextmanager
def _spoken(live: Live, console: Console) -> Iterator[None]:
    """The first line of what would be drawn, said by a thread of its own: the control loop waits for no pipe."""
    over = threading.Event()

    def speak() -> None:
        while not over.wait(LINE_S):
            console.say(live.lines()[0])

    # A daemon: where nobody reads the pipe, the line that waits in it must not keep the command from its end.
    speaker = threading.Thread(target=speak, name="progress", daemon=True)
    speaker.start()
    try:
        yield
    finally:
        over.set()


def hears_keys(stream: Any = None) -> bool:
    """Whether somebody at a terminal can press a key. stream: instead of stdin (tests)."""
    source = sys.stdin if stream is None else stream
    try:
        return source is not None and bool(source.isatty())
    except ValueError:  # closed
        return False


def way_to_stop() -> str:
    """How whoever sits here stops the robot at once, in words."""
    return "space is the emergency stop" if hears_keys() else "no terminal: Ctrl-C or kill stops it, no key does"


@contextlib.contextmanager
def stop_key(halt: Callable[[], None], *, stream: Any = None) -> Iterator[None]:
    """Call `halt` when the space bar is pressed, from a thread of its own; nothing where stdin is no terminal.

    stream: read instead of stdin (tests).
    """
    source = sys.stdin if stream is None else stream
    if not hears_keys(source):
        yield
        return
    import select
    import termios
    import tty

    descriptor = source.fileno()
    before = termios.tcgetattr(descriptor)
    ended = threading.Event()

    def listen() -> None:
        with contextlib.suppress(OSError):  # the terminal was closed
            while not ended.is_set():
                ready, _, _ = select.select([descriptor], [], [], 0.05)
                key = os.read(descriptor, 1) if ready else None
                if key == b"":  # so it looks as well
                    return
                if key == STOP_KEY.encode():
                    halt()

    thread = threading.Thread(target=listen, name="stop-key", daemon=True)
    try:
        tty.setcbreak(descriptor)  # one key, no Enter; Ctrl-C stays what it is
        thread.start()
        yield
    finally:
        ended.set()
        if thread.ident is not None:
            thread.join()
        with contextlib.suppress(termios.error):  # as above
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)

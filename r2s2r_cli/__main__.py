"""The entry point: `r2s2r` and `python -m r2s2r_cli`."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

from r2s2r_cli.stopping import POLITE, STOP

SOON_S = 0.02
"""After which a swallowed interrupt comes again."""


def main() -> None:
    """Load the app and run it. Ctrl-C, SIGTERM and SIGHUP count as an interrupt from the first moment to the last,
    without a traceback.

    Matrices are small here: threads of BLAS and torch cost more than they bring (48 s of processor time instead of 39 s
    for one diagnosis by those of BLAS, 3.4 s become 8.5 s for its probes by those of torch, and ten times as long where
    other programs want the cores too), and sums would depend on how many there are. The engine has its own.
    """
    sys.unraisablehook = again(sys.unraisablehook)
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    try:
        early: list[int] = []
        for number in (signal.SIGINT, *POLITE):
            if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, lambda told, _: early.append(told))
        from r2s2r_cli.app import app  # compiled modules do not take an exception out of the blue while they load

        STOP.listen()
        if early:
            raise KeyboardInterrupt
        app()
    except KeyboardInterrupt:
        print("interrupted: nothing was done", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own exit has nothing to interrupt


def again(usual: Callable[[Any], object]) -> Callable[[Any], object]:
    """A hook for what Python can raise nowhere: an interrupt that fell into the callback of a weak reference or into a
    finaliser is not lost and says nothing, but comes once more."""

    def hook(raised: Any) -> None:
        if raised.exc_type is KeyboardInterrupt:
            later = threading.Timer(SOON_S, os.kill, (os.getpid(), signal.SIGINT))  # at once it falls into this hook
            later.daemon = True
            later.start()
        else:
            usual(raised)

    return hook


if __name__ == "__main__":
    main()

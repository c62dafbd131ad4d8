"""The entry point: `r2s2r` and `python -m r2s2r_cli`."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Load the app and run it. Ctrl-C counts as an interrupt from the first moment to the last, without a traceback."""
    try:
        early: list[int] = []
        usual = signal.signal(signal.SIGINT, lambda number, _: early.append(number))
        from r2s2r_cli.app import app  # compiled modules do not take an exception out of the blue while they load

        signal.signal(signal.SIGINT, usual or signal.default_int_handler)
        if early:
            raise KeyboardInterrupt
        app()
    except KeyboardInterrupt:
        print("interrupted: nothing was done", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own exit has nothing to interrupt


if __name__ == "__main__":
    main()

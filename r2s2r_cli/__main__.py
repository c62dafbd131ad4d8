"""The entry point: `r2s2r` and `python -m r2s2r_cli`."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Load the app and run it. Ctrl-C counts as an interrupt from the first moment, not only once all is loaded."""
    try:
        from r2s2r_cli.app import app

        app()
    except KeyboardInterrupt:
        print("interrupted: nothing was done", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own exit has nothing to interrupt


if __name__ == "__main__":
    main()

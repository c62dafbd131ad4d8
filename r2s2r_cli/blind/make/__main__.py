"""`python -m r2s2r_cli.blind.make`: what `r2s2r blind make` runs as a process of its own."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from r2s2r_cli.blind.labels import new_key, read_key
from r2s2r_cli.blind.make.bank import Asked, make
from r2s2r_cli.blind.make.effects import STARRED
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import R2S2RError


def main(arguments: list[str]) -> int:
    """Make the bank; a JSON line a set on stdout. Gives the exit code."""
    parser = argparse.ArgumentParser(prog="python -m r2s2r_cli.blind.make")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--key", type=Path, required=True)
    parser.add_argument("--tier", choices=["A", "B"], default="B")
    parser.add_argument("--bank", type=Bank, choices=list(Bank), default=Bank.CALIBRATION)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--first", type=int)
    parser.add_argument("--commissioning", type=int, default=2)
    parser.add_argument("--observed", type=int, default=0)
    parser.add_argument("--effect", choices=sorted(STARRED))
    parser.add_argument("--gaits", type=int)
    parser.add_argument("--no-oracle", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--executor", default="local")
    given = parser.parse_args(arguments)
    try:
        # A key that is there belongs to a bank that was begun: go on with it.
        key = read_key(given.key) if given.key.exists() else new_key(given.key)
        asked = Asked(given.bank, given.count, given.out, key, given.first, given.commissioning, given.observed,
                      given.effect, given.gaits, given.tier, not given.no_oracle)  # fmt: skip
        for done, name in enumerate(make(asked, executor=given.executor, workers=given.workers), 1):
            sys.stdout.write(json.dumps({"done": done, "of": given.count, "set": name}) + "\n")
            sys.stdout.flush()
    except R2S2RError as error:
        sys.stderr.write("\n".join(error.lines()) + "\n")
        return int(error.exit_code)
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

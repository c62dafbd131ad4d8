"""`python -m r2s2r_cli.blind.make`: what `r2s2r blind make` and (first word `follow`) `r2s2r blind follow` run as a
process of its own."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from r2s2r_cli.blind.labels import new_key, read_key
from r2s2r_cli.blind.make.bank import Asked, make
from r2s2r_cli.blind.make.begun import check_key
from r2s2r_cli.blind.make.effects import STARRED
from r2s2r_cli.blind.make.follow import NUMBERS, Followed, follow
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import R2S2RError


def main(arguments: list[str]) -> int:
    """Make the bank, or what follows on its verdicts; a JSON line a set on stdout, and one of an error of ours.
    Gives the exit code."""
    return _follow(arguments[1:]) if arguments[:1] == ["follow"] else _make(arguments)


def _make(arguments: list[str]) -> int:
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
    parser.add_argument("--noise", type=float)
    parser.add_argument("--no-oracle", action="store_true")
    parser.add_argument("--camera", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--executor", default="local")
    given = parser.parse_args(arguments)

    def names() -> Iterator[str]:
        # A key that is there belongs to a bank that was begun: go on with it.
        check_key(given.out, given.key)
        key = read_key(given.key) if given.key.exists() else new_key(given.key)
        asked = Asked(given.bank, given.count, given.out, key, given.first, given.commissioning, given.observed,
                      given.effect, given.gaits, given.noise, given.tier,
                      not given.no_oracle, given.camera, str(given.key))  # fmt: skip
        return make(asked, executor=given.executor, workers=given.workers)

    return _told(names, given.count)


def _follow(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m r2s2r_cli.blind.make follow")
    parser.add_argument("--bank", type=Path, required=True)
    parser.add_argument("--key", type=Path, required=True)
    parser.add_argument("--asked", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--executor", default="local")
    given = parser.parse_args(arguments)
    asked = json.loads(given.asked.read_text(encoding="utf-8"))

    def names() -> Iterator[str]:
        wanted = Followed(given.bank, given.out, read_key(given.key), asked["sets"], asked["seed"])
        return follow(wanted, executor=given.executor, workers=given.workers)

    return _told(names, len(NUMBERS) * len(asked["sets"]))


def _told(names: Callable[[], Iterator[str]], count: int) -> int:
    try:
        for done, name in enumerate(names(), 1):
            sys.stdout.write(json.dumps({"done": done, "of": count, "set": name}) + "\n")
            sys.stdout.flush()
    except R2S2RError as error:
        # Whoever started this process says it in its own name.
        sys.stdout.write(json.dumps({"error": error.facts}) + "\n")
        return int(error.exit_code)
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

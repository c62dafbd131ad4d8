"""A hint that is one option alone becomes the command line as it was typed, with that option in its place."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from r2s2r_cli.errors import R2S2RError


def whole(error: R2S2RError, arguments: Sequence[str]) -> str:
    """The hint of an error; where it reads `--name value`, the command line with it. arguments: as typed after `r2s2r`.

    The option takes the place of the one that was wrong: of the same name, and with the value that the error received,
    or names as its place (`--to 5,5,0`), or, of `--set KEY=VALUE`, the key. Where there is none it comes last.
    """
    said, gap, remark = error.hint.partition("   #")
    try:
        words = shlex.split(said)
    except ValueError:
        return error.hint
    if len(words) != 2 or not words[0].startswith("--") or not arguments:
        return error.hint
    return shlex.join(["r2s2r", *_placed(arguments, words[0], words[1], error)]) + gap + remark


def _placed(arguments: Sequence[str], name: str, value: str, error: R2S2RError) -> list[str]:
    key, received = value.partition("=")[0], error.received
    named = error.where.removeprefix(f"{name} ")
    keys = {received, key, f"{key.rpartition('.')[0]}.{received}", named}
    found = list(arguments)
    places: list[tuple[int, int, bool]] = []
    for i, word in enumerate(found):
        option, equals, behind = word.partition("=")
        at, given = (i, behind) if equals else (i + 1, found[i + 1] if i + 1 < len(found) else "")
        given_key = given.partition("=")[0].strip()
        # What was received as it stands is the wrong one, though another has the same key.
        rank = 0 if given in (received, named) else 1 if given_key == named else 2 if given_key in keys else 3
        if option == name and (rank < 3 or "=" not in value):
            places.append((rank, at, bool(equals)))
    if not places:
        return [*found, name, value]
    _, at, joined = min(places)  # the one that was wrong, else the first of that name
    found[at : at + 1] = [f"{name}={value}" if joined else value]
    return found

"""The command line as it was typed, for hints that ask for the same with something more."""

from __future__ import annotations

import shlex
import sys


def typed_words(command: str) -> list[str]:
    """The words after `r2s2r`, the command first; the command alone where another one runs it."""
    return sys.argv[1:] if sys.argv[1:2] == [command] else [command]


def typed_again(command: str, *more: str) -> str:
    """The command line as typed, with the flags of `more`."""
    words = [word for word in typed_words(command) if word not in more]
    return shlex.join(["r2s2r", *words, *more])

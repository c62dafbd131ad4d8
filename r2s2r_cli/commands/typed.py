"""The command line as it was typed, for hints that ask for the same with something more."""

from __future__ import annotations

import shlex
import sys


def typed_words(command: str) -> list[str]:
    """The words after `r2s2r`, the command first; the command alone where another one runs it."""
    return sys.argv[1:] if sys.argv[1:2] == [command] else [command]


def typed_instead(command: str, wrong: str, right: str) -> str:
    """The command line as typed, with the value `right` where `wrong` was given, alone or behind `=` or `:`; where it
    was not typed, the command and what would have been right."""
    words = typed_words(command)
    new = [word[: -len(wrong)] + right if _is(word, wrong) else word for word in words]
    return shlex.join(["r2s2r", *(new if new != words else [command, right])])


def _is(word: str, value: str) -> bool:
    return word == value or word.endswith((f"={value}", f":{value}"))


def typed_again(command: str, *more: str) -> str:
    """The command line as typed, with the flags of `more`."""
    words = [word for word in typed_words(command) if word not in more]
    return shlex.join(["r2s2r", *words, *more])

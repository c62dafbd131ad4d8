"""The known name that a misspelt one was probably meant to be: one limit of distance for all hints."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches

NEAR = 0.6
"""How alike two spellings are at least (1: the same) for the one to be offered in place of the other. Below it a hint
would have the user paste what they never meant."""


def nearest(word: str, known: Collection[str]) -> str:
    """The known name that is spelt like a wrong one; empty where none is near."""
    return next(iter(get_close_matches(word, list(known), 1, NEAR)), "")

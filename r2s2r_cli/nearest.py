"""The known name that a misspelt one was probably meant to be: one limit of distance for all hints."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches

NEAR = 0.6
"""How alike two spellings are at least (1: the same) for the one to be offered in place of the other. Below it a hint
would have the user paste what they never meant."""
SHORT = 4
"""Of a word of so few letters nearly any other has most: there a single slip is near, and nothing further."""


def nearest(word: str, known: Collection[str]) -> str:
    """The known name that is spelt like a wrong one; empty where none is near."""
    alike = get_close_matches(word, list(known), max(1, len(known)), NEAR)
    return next((one for one in alike if len(word) > SHORT or one.startswith(word) or _one_slip(word, one)), "")


def nearest_choice(word: str, known: Collection[str]) -> str:
    """The likeliest of a closed set of choices, however far: only where one of the few must be meant, and where it does
    no harm to try the wrong one. known: not empty."""
    return get_close_matches(word, list(known), 1, 0.0)[0]


def _one_slip(word: str, meant: str) -> bool:
    """Whether one letter is missing, too many or another one, or two neighbours are swapped."""
    head = next((i for i, (a, b) in enumerate(zip(word, meant, strict=False)) if a != b), min(len(word), len(meant)))
    a, b = word[head:], meant[head:]
    return a[1:] == b[1:] or a[1:] == b or a == b[1:] or (a[:2] == b[1::-1] and a[2:] == b[2:])

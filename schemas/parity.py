"""What the logs say against each other, one finding a row. A report has it in three columns, two of them later ones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, NamedTuple


class ParityFound(NamedTuple):
    """One finding in words. sd: how far it stands out [sd], None before this was noted; effect: the one that it speaks
    for most, empty for none and before this was noted."""

    words: str
    sd: float | None
    effect: str


def columns(found: Sequence[ParityFound]) -> dict[str, Any]:
    """The fields of `DiagnoseReport` that hold these findings."""
    return {
        "parity": tuple(one.words for one in found), "parity_sd": tuple(one.sd for one in found),
        "parity_effects": tuple(one.effect for one in found),
    }  # fmt: skip


def rows(parity: Sequence[str], sd: Sequence[float], effects: Sequence[str]) -> tuple[ParityFound, ...]:
    """The findings of these fields: the two that came later are empty in older reports."""
    return tuple(ParityFound(words, far, effect or "") for words, far, effect in zip_longest(parity, sd, effects))

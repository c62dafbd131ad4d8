"""Whether one more gait decided an ambiguous set: `blind follow` knows no label, so it is judged here."""

from __future__ import annotations

from typing import Any

from r2s2r_cli.blind.score.facts import NONE, UNKNOWN, Truth


def resolved(truth: Truth, told: dict[str, Any] | None) -> bool:
    """Committed, and rightly. None: no gait was suggested, so the set stays as it was."""
    if told is None or told.get("failed") or not told["committed"]:
        return False
    verdict, named = told["verdict"], tuple(told.get("named") or ())
    if verdict == "no_gap":
        return truth.right == NONE
    if verdict == "unknown":
        return truth.right == UNKNOWN
    if verdict == "pair":
        return truth.kind == "pair" and set(named) == set(truth.effects)
    return verdict == "effect" and truth.kind == "single" and named == truth.effects

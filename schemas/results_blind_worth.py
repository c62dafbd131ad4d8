"""What each kind of evidence of a diagnosis is worth: printed as a table, and put into `--json` documents."""

from __future__ import annotations

from schemas.base import Frozen


class BlindWorthRow(Frozen):
    """What the first guesses are without one kind of evidence. Counts are of sets."""

    without: str
    clear: int
    """Single effects that can be told."""
    top1: int
    top3: int
    named: int
    """Of the clear ones, those with a name that is committed to."""
    right: int
    none: int
    """Nothing is wrong in them."""
    alarms: int
    """Of those, with a name that is committed to."""
    strangers: int
    """Outside of every catalogue, clear or weak."""
    strangers_named: int
    lost: int
    """Clear ones whose truth is first with all evidence and not without this kind."""
    won: int
    log_loss: float
    """Of the truth, strangers and pairs left out [nats]."""


class BlindWorthResult(Frozen):
    """The same judged sets with all evidence, and without each kind."""

    learned: int
    """Sets that taught the probabilities."""
    judged: int
    rows: tuple[BlindWorthRow, ...]
    warnings: tuple[str, ...] = ()

"""What each kind of evidence of a diagnosis is worth: printed as a table, and put into `--json` documents."""

from __future__ import annotations

from schemas.base import Frozen
from schemas.results_blind import BlindCounts


class BlindWorthRow(BlindCounts):
    """What the first guesses are without one kind of evidence."""

    without: str
    alarms: int
    """Of those with nothing wrong, the sets with a name that is committed to."""
    strangers: int
    """Outside of every catalogue, clear or weak."""
    strangers_named: int
    lost: int
    """Clear ones whose truth is first with all evidence and not without this kind."""
    won: int
    log_loss: float
    """Of the truth, pairs left out [nats]."""


class BlindWorthResult(Frozen):
    """The same judged sets with all evidence, and without each kind."""

    learned: int
    """Sets that taught the probabilities."""
    judged: int
    rows: tuple[BlindWorthRow, ...]
    warnings: tuple[str, ...] = ()

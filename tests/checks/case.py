"""The form of the lists in `cases_*.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Case:
    """A subject that one check must complain about, word by word."""

    check: str
    subject: Callable[[], object]
    found: tuple[tuple[str, str, str, str], ...]
    """(location, what, expected, received)."""


@dataclass(frozen=True)
class Edge:
    """A subject at the edge of one check that must pass it."""

    check: str
    why: str
    subject: Callable[[], object]

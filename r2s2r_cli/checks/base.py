"""What a check is: a short function from a value to what is wrong with it, and the facts that document it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np

from r2s2r_cli.errors import quoted
from schemas.results import Finding

Importance = Literal["error", "warning", "advice"]
IMPORTANCES: dict[Importance, str] = {
    "error": "the data contradict themselves, their schema or the robot: what is computed from them is wrong",
    "warning": "the data can be used, and something in them is probably not what you think",
    "advice": "nothing is wrong; something could be better",
}
Subject = TypeVar("Subject")
AGAIN = "{again}"
"""In a fix: the command that makes the artifact again. Who knows the project fills it in (`told_again`)."""
REPORT = f"{AGAIN}   # report it if that does not help"


class Found(NamedTuple):
    """One thing that a check found."""

    location: str
    """Path inside the file: of a dataset (`runs/crawl/caps/p_WE`), an attribute (`...@name`), or a TOML key."""
    what: str
    """One sentence, no full stop, with the element that is wrong."""
    expected: str
    received: str
    hint: str = ""
    """Overrides the check's `fix`, where this one place needs another remedy."""


@dataclass(frozen=True)
class Check:
    """One entry of the registry."""

    name: str
    importance: Importance
    subject: type
    """What its function takes: one of `checks.subjects`, or the robot description."""
    kinds: tuple[str, ...]
    """Artifact kinds it looks at; empty: every one."""
    what: str
    why: str
    fix: str
    """A line that can be pasted, with its remark behind it; or, where only a person can mend it, what to do in words
    without a command. `{file}` and `{location}` are filled in, `AGAIN` by who knows the project."""
    function: Callable[[Any], Iterator[Found]]
    family: str

    def looks_at(self, subject: object) -> bool:
        """Whether this check is made for a subject like this one."""
        kind = getattr(subject, "kind", "")
        return isinstance(subject, self.subject) and (not self.kinds or kind in self.kinds)

    def run(self, subject: object, file: str) -> list[Finding]:
        """What it finds in one subject of a file."""
        with np.errstate(all="ignore"):  # absurd numbers overflow; the comparison that follows says so in words
            return [self._finding(found, file) for found in self.function(subject)]

    def _finding(self, found: Found, file: str) -> Finding:
        hint = (found.hint or self.fix).replace("{file}", quoted(file)).replace("{location}", quoted(found.location))
        location = found.location.removeprefix(file).lstrip(":, ")  # errors of the store name the file in their `where`
        return Finding(
            check=self.name, importance=self.importance, file=file, location=location, what=found.what,
            expected=found.expected, received=found.received, hint=hint,
        )  # fmt: skip


def check(
    importance: Importance, subject: type[Subject], *, kinds: tuple[str, ...] = (), what: str, why: str, fix: str
) -> Callable[[Callable[[Subject], Iterator[Found]]], Check]:
    """Make a check of a function that takes `subject` and yields what is wrong; its name is the function's."""

    def wrap(function: Callable[[Subject], Iterator[Found]]) -> Check:
        family = function.__module__.rpartition(".")[2]
        return Check(function.__name__, importance, subject, kinds, what, why, fix, function, family)

    return wrap


def run_checks(checks: Sequence[Check], subject: object, file: str) -> list[Finding]:
    """Findings of all checks that look at subjects like this one, in the order of the registry."""
    return [finding for entry in checks if entry.looks_at(subject) for finding in entry.run(subject, file)]


def number(value: float, scale: float = 1.0) -> str:
    """A number as people read it: four digits."""
    return f"{float(value) * scale:.4g}"


def worst(values: np.ndarray, excess: np.ndarray, axes: Sequence[str], *, scale: float = 1.0, unit: str = "") -> str:
    """`-0.2 at row 3, cable 1 (and 4 more)`: the place with the largest excess; places count where it is above 0.

    values and excess: the same shape; axes: the name of each axis. NaN in excess is not a place.
    """
    excess = np.where(np.isnan(excess), 0.0, excess)
    place = np.unravel_index(int(np.argmax(excess)), excess.shape)
    count = int((excess > 0).sum())
    where = ", ".join(f"{axis} {index}" for axis, index in zip(axes, place, strict=True))
    more = f" (and {count - 1} more)" if count > 1 else ""
    return f"{number(values[place], scale)}{' ' if unit else ''}{unit}" + (f" at {where}" if where else "") + more


def beyond(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """How far each value lies outside [low, high]; 0 inside and for NaN."""
    return np.nan_to_num(np.maximum(np.maximum(low - values, values - high), 0.0), nan=0.0, posinf=np.inf)


def sentence(text: str) -> str:
    """`text` with a capital and a full stop, for the pages."""
    return re.sub(r"\.*$", ".", text[:1].upper() + text[1:])

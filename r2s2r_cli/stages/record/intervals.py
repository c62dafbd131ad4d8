"""Target intervals and segments while a run is recorded: written when one ends, so that a crash loses the last."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from r2s2r_cli.stages.segments import Intervals, segments

NamedRow = tuple[str, dict[str, Any]]
"""Stream and row."""


class OpenInterval:
    """Control ticks of the present target, until another target begins or the run ends."""

    def __init__(self) -> None:
        self._count = 0
        self._rows = 0
        self._target = np.zeros(0)
        self._t: list[float] = []
        self._control: list[np.ndarray] = []
        self._there = False

    @property
    def count(self) -> int:
        """Intervals that have ended."""
        return self._count

    def tick(self, t: float, target: np.ndarray, control: np.ndarray, done: np.ndarray) -> list[NamedRow]:
        """A row of `commands`. Returns rows (stream, row) of the interval that it ended, if it did."""
        ended = self.close(complete=True) if self._t and not np.array_equal(target, self._target) else []
        self._target = np.array(target, dtype=float)
        self._t.append(t)
        self._control.append(np.array(control, dtype=float))
        self._there = bool(np.all(done))
        return ended

    def close(self, *, complete: bool | None = None) -> list[NamedRow]:
        """Ends the present interval. complete: default whether its cables had all arrived. Rows as (stream, row)."""
        if not self._t:
            return []
        n, t = len(self._t), np.array(self._t)
        one = Intervals(
            first=np.array([0]), last=np.array([n - 1]), t_first=t[:1], t_last=t[-1:], target=self._target[None],
            complete=np.array([self._there if complete is None else complete]),
        )  # fmt: skip
        parts = segments(one, t, np.array(self._control))
        rows: list[NamedRow] = [("intervals", self._shifted(_row(vars(one), 0)))]
        for i in range(len(parts)):
            rows.append(("segments", self._shifted({**_row(vars(parts), i), "interval": self._count + 1})))
        self._count += 1
        self._rows += n
        self._t, self._control = [], []
        return rows

    def _shifted(self, row: dict[str, Any]) -> dict[str, Any]:
        return {**row, "first": row["first"] + self._rows, "last": row["last"] + self._rows}


def _row(columns: Mapping[str, Any], i: int) -> dict[str, Any]:
    return {name: column[i] for name, column in columns.items()}

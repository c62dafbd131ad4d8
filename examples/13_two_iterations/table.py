"""From comparisons to the table of the example: error, floor and what is left above it, and by how much that fell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from statistics import median
from typing import Any

MEASURES = {"com_end_m": ("centre of mass at the end", 1e3, "mm"), "heading_end_rad": ("heading", 57.2958, "deg"),
            "segment_s": ("duration of a segment", 1.0, "s")}  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One measure of one seed on one set of runs. error, gap (above the floor): by simulator."""

    seed: str
    runs: str
    measure: str
    floor: float | None
    error: Mapping[str, float]
    gap: Mapping[str, float]

    def falls(self, model: str) -> float | None:
        """By what factor the gap fell against robot.toml; inf: to the floor; None without a floor or gap."""
        first, now = self.gap.get("initial"), self.gap.get(model)
        if first is None or now is None or first == 0:
            return None
        return first / now if now > 0 else inf


RUNS = {1: "the same runs", 2: "new policies"}
"""By the iteration in which they were executed: iteration 2 learned from the first, nothing from the second."""


def rows_of(report: Mapping[str, Any], seed: str) -> Iterator[Row]:
    """The rows of one comparison, of the runs of both iterations."""
    for number, runs in RUNS.items():
        mine = [one for one in report["history"] if one["iteration"] == number]
        for measure in MEASURES:
            known = {one["model"]: one["runs"][measure] for one in mine if measure in one["runs"]}
            floor = next((one["floor"] for one in known.values()), None)
            yield Row(
                seed, runs, measure, floor, {name: one["rms"] for name, one in known.items()},
                {name: one["gap"] for name, one in known.items() if one["gap"] is not None},
            )  # fmt: skip


def summary(rows: Sequence[Row]) -> Iterator[str]:
    """The table, median and range over seeds."""
    models = list(dict.fromkeys(name for row in rows for name in row.error))
    yield f"{'':14} {'':26} {'floor':>8}" + "".join(f"{name:>28}" for name in models) + "   by what factor the gap fell"
    for runs in dict.fromkeys(row.runs for row in rows):
        for measure, (words, scale, unit) in MEASURES.items():
            mine = [row for row in rows if row.runs == runs and row.measure == measure]
            floors = [scale * row.floor for row in mine if row.floor is not None]
            cells = "".join(f"{_spread([scale * row.error[name] for row in mine if name in row.error]):>28}"
                            for name in models)  # fmt: skip
            fall = "   ".join(
                f"{name} {_factor([row.falls(name) for row in mine])}" for name in models if name != "initial"
            )
            floor = f"{median(floors):8.2f}" if floors else "       -"
            yield f"{runs:14} {words + ' [' + unit + ']':26} {floor}{cells}   {fall}"


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "-"
    if len(values) == 1:
        return f"{values[0]:.2f}"
    return f"{median(values):.2f} ({min(values):.2f} .. {max(values):.2f})"


def _factor(values: Sequence[float | None]) -> str:
    known = sorted(value for value in values if value is not None)
    if not known:
        return "-"

    def text(value: float) -> str:
        return "to the floor" if value == inf else f"{value:.1f}"

    if len(known) == 1:
        return text(known[0])
    middle = known[len(known) // 2] if len(known) % 2 else min(known[len(known) // 2 - 1], known[len(known) // 2])
    return f"{text(middle)} ({text(known[0])} .. {text(known[-1])})"

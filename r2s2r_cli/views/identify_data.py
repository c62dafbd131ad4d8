"""How views read an identification: words, roles, numbers in the units of their rows."""

from __future__ import annotations

import math

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import GREEN, ORANGE, PURPLE, RED

TRAIN, TEST = 1, 2
"""Codes of `role`."""
ROLE_WORDS = {0: "not used", TRAIN: "train", TEST: "test"}
ROLE_COLORS = {0: "#9aa5b1", TRAIN: "#0b5fa5", TEST: "#c1272d"}
_ROUNDING = 1e-12
TRUST_COLORS = {0: GREEN, 1: ORANGE, 2: RED, 3: PURPLE, 4: "#9aa5b1"}
"""Nothing but its colour says what a row of the parameters is worth: of a palette that colour-blind people can tell."""
TRUST_WORDS = {0: "identified", 1: "weak", 2: "not identifiable", 3: "on a bound", 4: "fixed"}


def words(group: Group, name: str) -> list[str]:
    """A dataset of text as Python strings."""
    return [value.decode("utf-8", errors="replace") for value in group[name].tolist()]


def segment_names(segments: Group) -> list[str]:
    """`crawl:8` of every segment; the number alone where there is one run."""
    runs = words(segments, "run")
    alone = len(set(runs)) == 1
    return [f"{i}" if alone else f"{run}:{i}" for run, i in zip(runs, segments["interval"].tolist(), strict=True)]


def intervals_by_role(data: ArtifactData, run: str) -> dict[int, int]:
    """Target interval -> role, of one run."""
    segments = data.groups.get("segments")
    if segments is None:
        return {}
    rows = zip(words(segments, "run"), segments["interval"].tolist(), segments["role"].tolist(), strict=True)
    return {interval: role for name, interval, role in rows if name == run}


def figure_of(value: float | None, digits: int = 4) -> str:
    """A number as people read it; a dash where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def near_zero(value: float, *bounds: float | None) -> float:
    """The number, or 0 where it is what rounding leaves of 0, in shares of its bounds."""
    scale = max((abs(one) for one in bounds if one is not None and math.isfinite(one)), default=1.0)
    return 0.0 if abs(value) < _ROUNDING * scale else value


def millimetres(value: float | None, digits: int = 1) -> str:
    """Metres as millimetres; a dash where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{1e3 * value:.{digits}f}"


def spread(interval: tuple[float, float] | None, digits: int = 1) -> str:
    """` (6.9 .. 10.1)` of an interval in metres; nothing where there is none."""
    if interval is None or not all(map(math.isfinite, interval)):
        return ""
    return f" ({millimetres(interval[0], digits)} .. {millimetres(interval[1], digits)})"


def shown_in_log(values: np.ndarray) -> np.ndarray:
    """Values above 0 for an axis with a logarithmic scale; NaN elsewhere, which is not drawn."""
    return np.where(values > 0, values, np.nan)

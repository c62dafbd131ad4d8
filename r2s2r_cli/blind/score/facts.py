"""What was true and what was said, of one set: labels and verdicts as values that can be compared."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

NONE, UNKNOWN = "none", "unknown"
WEAK, CLEAR = 3.0, 8.0
"""Bounds of d between what lies under the floor, weak, and clear."""


@dataclass(frozen=True)
class Truth:
    """kind: none | single | pair | outside. effects: ids. d: of everything together, 0 where nothing is wrong (up to
    `blind-b-11` of all gaits, since then of the fitted ones); each: of every effect. element: {"kind", "index"} of a
    single one that has one. place: of a patch [m]. onset: target interval of the set with which it begins, 1-based;
    None: it holds throughout. noise_m, gaits, rate_hz: of what was recorded.
    """

    kind: str
    effects: tuple[str, ...]
    d: float
    each: tuple[float, ...]
    channel: str | None
    element: dict[str, Any] | None
    place: tuple[float, float] | None
    onset: dict[str, Any] | None
    name: str
    """In words, for tables."""
    noise_m: float | None = None
    gaits: int | None = None
    rate_hz: float | None = None

    @property
    def stratum(self) -> str:
        """none, sub-floor, weak or clear."""
        if self.kind == "none":
            return "none"
        return "sub-floor" if self.d < WEAK else "weak" if self.d < CLEAR else "clear"

    @property
    def right(self) -> str | None:
        """The one right answer; None: of a pair there are two."""
        if self.kind == "none" or self.d < WEAK:
            return NONE
        if self.kind == "outside":
            return UNKNOWN
        return self.effects[0] if self.kind == "single" else None


@dataclass(frozen=True)
class Said:
    """A verdict. order: ids, `none` and `unknown` from the most probable on; probabilities beside them. named: what it
    commits to. failed: it broke off, and says nothing. rmse: of names that were fitted, at the ends of intervals that
    were left out [m]. suggested, random: whether one more gait decided the set, rightly; None: nobody tried."""

    verdict: str
    named: tuple[str, ...]
    order: tuple[str, ...]
    probability: tuple[float, ...]
    set90: tuple[str, ...]
    channel: str | None
    element: dict[str, Any] | None
    onset: int | None
    own_share: float | None
    predicted: float | None
    failed: bool
    cpu_s: float | None = None
    rmse: dict[str, float] = field(default_factory=dict)
    suggested: bool | None = None
    random: bool | None = None

    @property
    def first(self) -> str:
        """The most probable answer; empty where there is none."""
        return self.order[0] if self.order else ""


def truth_of(label: dict[str, Any]) -> Truth:
    """Of a label. One without d (`make --no-oracle`) counts as under the floor."""
    effects = label["effects"]
    one = effects[0] if label["kind"] == "single" else None
    element = one["element"] if one else None
    place = element.get("xy_m") if element and element["kind"] == "place" else None
    outside = label["outside"]
    return Truth(
        kind=label["kind"], effects=tuple(e["id"] for e in effects), d=float(label["d"] or 0.0),
        each=tuple(label["d_each"] or ()), channel=one["channel"] if one else outside["channel"] if outside else None,
        element=element if element and element.get("index") is not None else None,
        place=None if place is None else (float(place[0]), float(place[1])), onset=one["onset"] if one else None,
        name=outside["name"] if outside else " + ".join(e["id"] for e in effects) or NONE,
        noise_m=label.get("noise_m"), gaits=label.get("gaits"), rate_hz=label.get("rate_hz"),
    )  # fmt: skip


def said_of(verdict: dict[str, Any]) -> Said:
    """Of a verdict file; one that failed says nothing."""
    document = verdict.get("diagnosis") or {}
    if verdict.get("failed") or not document:
        return Said("failed", (), (), (), (), None, None, None, None, None, True, verdict.get("cpu_s"))
    ranking = sorted(document["ranking"], key=lambda row: -float(row["probability"]))
    where, shrunk = document.get("where") or {}, document.get("shrinkage") or {}
    kind = document["verdict"]
    named = tuple(document["effects"]) if kind in ("effect", "pair") else ()
    return Said(
        verdict=kind, named=named, order=tuple(row["effect"] for row in ranking),
        probability=tuple(float(row["probability"]) for row in ranking), set90=tuple(document["set90"]),
        channel=where.get("channel"), element=where.get("element"), onset=where.get("onset_segment"),
        own_share=shrunk.get("own_share"), predicted=shrunk.get("predicted"), failed=False,
        cpu_s=verdict.get("cpu_s"),
        rmse={row["effect"]: float(row["rmse_m"]) for row in ranking if row.get("rmse_m") is not None},
    )  # fmt: skip

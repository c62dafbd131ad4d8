"""The same few counts for every noise, number of gaits and rate: where a diagnosis is hard."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Literal

from r2s2r_cli.blind.score.facts import Said, Truth
from schemas.results_blind import BlindSplit

By = Literal["noise", "gaits", "rate"]


def splits(pairs: Sequence[tuple[Truth, Said]]) -> tuple[BlindSplit, ...]:
    """Of noise, then gaits, then rate, each from its smallest value on; labels that do not say are left out."""
    found: list[BlindSplit] = []
    ways: tuple[tuple[By, str, list[float | None]], ...] = (
        ("noise", "{:g} mm", [None if t.noise_m is None else 1e3 * t.noise_m for t, _ in pairs]),
        ("gaits", "{:g}", [t.gaits for t, _ in pairs]),
        ("rate", "{:g} Hz", [t.rate_hz for t, _ in pairs]),
    )
    for by, form, values in ways:
        for value in sorted({one for one in values if one is not None}):
            own = [pair for pair, one in zip(pairs, values, strict=True) if one == value]
            found.append(_split(by, form.format(value), own))
    return tuple(found)


def _split(by: By, value: str, pairs: Sequence[tuple[Truth, Said]]) -> BlindSplit:
    clear = [(t, s) for t, s in pairs if t.kind == "single" and t.stratum == "clear"]
    named = [(t, s) for t, s in clear if s.named]
    nothing = [s for t, s in pairs if t.kind == "none"]
    spent = [s.cpu_s for _, s in pairs if s.cpu_s is not None]
    return BlindSplit(
        by=by, value=value, sets=len(pairs), clear=len(clear), top1=sum(s.first == t.right for t, s in clear),
        top3=sum(t.right in s.order[:3] for t, s in clear), named=len(named),
        right=sum(s.named == t.effects for t, s in named), none=len(nothing),
        alarms=sum(s.verdict != "no_gap" for s in nothing), cpu_median_s=median(spent) if spent else None,
    )  # fmt: skip

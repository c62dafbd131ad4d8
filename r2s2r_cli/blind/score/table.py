"""The result of `blind score`: table, confusion matrix, calibration curve, recall, misses, splits and baselines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from r2s2r_cli.blind.score.baselines import baselines
from r2s2r_cli.blind.score.facts import Said, Truth
from r2s2r_cli.blind.score.rows import (
    BINS,
    CLASSES_LAST,
    CONTROL,
    METRICS,
    calibrated_error,
    calibration_error,
    coverage,
    row,
)
from r2s2r_cli.blind.score.splits import splits
from schemas.results_blind import BlindBin, BlindMiss, BlindRecall, BlindScoreResult


def score_of(
    found: Sequence[tuple[str, Truth, Said]], *, tier: Any, bank: str, sets: int, index: str,
    warnings: tuple[str, ...] = (), shuffled: bool = False,
) -> BlindScoreResult:  # fmt: skip
    """The table of truths and verdicts by name. shuffled: of the negative control, in which nothing is true."""
    pairs = [(t, s) for _, t, s in found]
    rows = [row(metric, pairs, tier) for metric in ((CONTROL,) if shuffled else METRICS)]
    rows += [] if shuffled else [coverage(pairs, tier), calibration_error(pairs, tier), calibrated_error(pairs)]
    classes, confusion = _confusion(pairs)
    return BlindScoreResult(
        tier=tier, bank=bank, sets=sets, scored=len(found), failed=sum(s.failed for _, s in pairs), index_sha256=index,
        strata=dict(Counter(t.stratum for t, _ in pairs)), rows=tuple(rows), classes=classes, confusion=confusion,
        calibration=_bins(pairs), recall=_recall(pairs), misses=_misses(found), splits=splits(pairs),
        baselines=() if shuffled else baselines(pairs, tier), warnings=warnings,
    )  # fmt: skip


def _decided(t: Truth) -> bool:
    return t.right is not None and t.stratum in ("none", "clear")


def _confusion(pairs: Sequence[tuple[Truth, Said]]) -> tuple[tuple[str, ...], tuple[tuple[int, ...], ...]]:
    counted = [(str(t.right), s.first or "failed") for t, s in pairs if _decided(t)]
    names = sorted({name for pair in counted for name in pair} - {*CLASSES_LAST, "failed"})
    classes = (*names, *CLASSES_LAST, *(("failed",) if any(said == "failed" for _, said in counted) else ()))
    count = Counter(counted)
    return classes, tuple(tuple(count[truth, said] for said in classes) for truth in classes)


def _bins(pairs: Sequence[tuple[Truth, Said]]) -> tuple[BlindBin, ...]:
    told = [(s.probability[0], s.first == t.right) for t, s in pairs if t.right is not None and s.order]
    found = []
    for k in range(BINS):
        part = [(p, right) for p, right in told if min(int(p * BINS), BINS - 1) == k]
        if part:
            said, right = (sum(column) / len(part) for column in zip(*part, strict=True))
            found.append(BlindBin(low=k / BINS, high=(k + 1) / BINS, n=len(part), said=said, right=right))
    return tuple(found)


def _recall(pairs: Sequence[tuple[Truth, Said]]) -> tuple[BlindRecall, ...]:
    found = []
    for effect in sorted({t.effects[0] for t, _ in pairs if t.kind == "single"}):
        own = [(t, s) for t, s in pairs if t.kind == "single" and t.effects == (effect,)]
        clear = [(t, s) for t, s in own if t.stratum == "clear"]
        found.append(BlindRecall(
            effect=effect, sets=len(own), clear=len(clear), top1=sum(s.first == effect for _, s in clear),
            top3=sum(effect in s.order[:3] for _, s in clear), named=sum(s.named == (effect,) for _, s in clear),
        ))  # fmt: skip
    return tuple(found)


def _misses(found: Sequence[tuple[str, Truth, Said]]) -> tuple[BlindMiss, ...]:
    return tuple(
        BlindMiss(
            set=name, truth=t.name, d=t.d, said=s.first or "nothing", verdict=s.verdict,
            probability=s.probability[0] if s.probability else None,
            rank=s.order.index(str(t.right)) + 1 if t.right in s.order else None, why=_why(t, s),
        )
        for name, t, s in found
        if _decided(t) and s.first != t.right
    )  # fmt: skip


def _why(t: Truth, s: Said) -> str:
    if s.failed:
        return "the diagnosis broke off"
    words = []
    if t.right in s.set90:
        words.append("in the 90 % set")
    if t.channel is not None:
        words.append("channel right" if s.channel == t.channel else f"channel {t.channel}, said {s.channel or 'none'}")
    if t.element is not None:
        words.append(f"{t.element['kind']} {t.element['index']}")
    return ", ".join(words)

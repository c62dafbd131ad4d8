"""`blind score`: opens the labels, checks what was committed to, and says how good the verdicts were.

It diagnoses nothing and simulates nothing; only it is given the key.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import digest, read_index
from r2s2r_cli.blind.score.calibrate import calibrated, case
from r2s2r_cli.blind.score.facts import Said, Truth, said_of, truth_of
from r2s2r_cli.blind.score.rows import AGAIN, BINS, CLASSES_LAST, CONTROL, METRICS, calibration_error, coverage, row
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import InputError
from schemas.results_blind import BlindBin, BlindMiss, BlindRecall, BlindRow, BlindScoreResult

__all__ = ["calibration", "score", "score_of"]


def score(bank: Path, verdicts: Path, key: bytes, *, again: Path | None = None) -> BlindScoreResult:
    """The table of a bank. again: verdicts on the same worlds under other noise (a bank of the same key, made with
    another `--observed`), to be compared. Raises InputError where a hash is not the published one, the key is another,
    or there is no verdict.
    """
    opened = _opened(bank, verdicts, key)
    found = [(name, truth_of(label), said_of(verdict)) for name, label, verdict in opened.sets]
    missing = opened.missing
    shuffled = any(verdict["shuffled"] is not None for _, _, verdict in opened.sets)
    index, own = opened.index, opened.own
    warnings = (f"{len(missing)} sets have no verdict: only the others are counted",) if missing else ()
    result = score_of(found, tier=index["tier"], bank=index["bank"], sets=len(index["sets"]), index=own,
                    warnings=warnings, shuffled=shuffled)  # fmt: skip
    if again is None:
        return result
    return result.model_copy(update={"rows": (*result.rows, _same(found, again, result.tier))})


def calibration(bank: Path, verdicts: Path, key: bytes) -> dict[str, Any]:
    """What the verdicts on a calibration bank teach about probabilities (`calibrate`). Raises InputError as `score`
    does, for another bank, and for too few sets."""
    opened = _opened(bank, verdicts, key)
    if opened.index["bank"] != Bank.CALIBRATION:
        raise InputError("only a calibration bank may teach anything", where=str(bank), expected="calibration",
                         received=str(opened.index["bank"]),
                         hint="r2s2r blind make --bank calibration --count 120 --key cal.key cal")  # fmt: skip
    told = [(truth_of(label), verdict) for _, label, verdict in opened.sets if not verdict["failed"]]
    cases = [one for one in (case(truth, verdict["diagnosis"]) for truth, verdict in told) if one is not None]
    return calibrated(cases, words=f"{len(cases)} sets of the calibration bank {opened.own[:12]}")


def score_of(
    found: Sequence[tuple[str, Truth, Said]], *, tier: Any, bank: str, sets: int, index: str,
    warnings: tuple[str, ...] = (), shuffled: bool = False,
) -> BlindScoreResult:  # fmt: skip
    """The table of truths and verdicts by name. shuffled: of the negative control, in which nothing is true."""
    pairs = [(t, s) for _, t, s in found]
    rows = [row(metric, pairs, tier) for metric in ((CONTROL,) if shuffled else METRICS)]
    rows += [] if shuffled else [coverage(pairs, tier), calibration_error(pairs, tier)]
    classes, confusion = _confusion(pairs)
    return BlindScoreResult(
        tier=tier, bank=bank, sets=sets, scored=len(found), failed=sum(s.failed for _, s in pairs), index_sha256=index,
        strata=dict(Counter(t.stratum for t, _ in pairs)), rows=tuple(rows), classes=classes, confusion=confusion,
        calibration=_bins(pairs), recall=_recall(pairs), misses=_misses(found), warnings=warnings,
    )  # fmt: skip


@dataclass(frozen=True)
class _Opened:
    """A bank with its verdicts: name, label, verdict of every set that has one; names of the others; list and hash."""

    sets: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...]
    missing: tuple[str, ...]
    index: dict[str, Any]
    own: str


def _opened(bank: Path, verdicts: Path, key: bytes) -> _Opened:
    index, own = read_index(bank / labels.INDEX)
    found: list[tuple[str, dict[str, Any], dict[str, Any]]] = []
    missing = []
    for name, facts in sorted(index["sets"].items()):
        path = verdicts / f"{name}.json"
        if not path.exists():
            missing.append(name)
            continue
        verdict = _verdict(path, own)
        if digest(bank / labels.SETS / name) != facts["logs"] or verdict["logs"] != facts["logs"]:
            raise InputError("the logs of a set were changed after the bank was closed", where=f"{labels.SETS}/{name}",
                             expected=facts["logs"], received=verdict["logs"],
                             hint="r2s2r blind make --out bank")  # fmt: skip
        sealed = bank / labels.LABELS / f"{name}.sealed"
        label = labels.opened(sealed.read_bytes(), key, facts["label"], where=str(sealed))
        found.append((name, label, verdict))
    if not found:
        raise InputError("there is no verdict to score", where=str(verdicts), expected="<set>.json of `blind run`",
                         received="none", hint=f"r2s2r blind run {bank} --out {verdicts}")  # fmt: skip
    return _Opened(tuple(found), tuple(missing), index, own)


def _verdict(path: Path, index: str) -> dict[str, Any]:
    try:
        verdict: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        of, _, _ = verdict["index"], verdict["logs"], verdict["shuffled"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError("a verdict cannot be read", where=str(path), expected="a file of `blind run`",
                         received=str(error), hint=f"rm {path}") from error  # fmt: skip
    if of != index:
        raise InputError("a verdict was found on another bank, or on another list of this one", where=str(path),
                         expected=index, received=str(of), hint="r2s2r blind run bank --out verdicts-2")  # fmt: skip
    if verdict.get("refused"):
        raise InputError("a verdict reached for the truth", where=str(path), expected="nothing refused",
                         received=str(verdict["refused"][0]), hint=f"rm {path}")  # fmt: skip
    return verdict


def _same(found: Sequence[tuple[str, Truth, Said]], again: Path, tier: Any) -> BlindRow:
    """How often other noise on the same world leaves the verdict as it is."""
    pairs = []
    for name, truth, said in found:
        path = again / f"{name}.json"
        if path.exists():
            other = said_of(json.loads(path.read_text(encoding="utf-8")))
            pairs.append((truth, replace(said, failed=(said.verdict, said.named) != (other.verdict, other.named))))
    if not pairs:
        raise InputError("there is no second verdict on any of these sets", where=str(again),
                         expected="verdicts on a bank of the same key, made with --observed 1", received="none",
                         hint="r2s2r blind make --observed 1 --key SAME.key again")  # fmt: skip
    return row(AGAIN, pairs, tier)


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
        words.append("channel right" if s.channel == t.channel else f"channel {t.channel}, said {s.channel}")
    if t.element is not None:
        words.append(f"{t.element['kind']} {t.element['index']}")
    return ", ".join(words)

"""`blind score`, `publish`, `calibrate`, `worth`: open the labels, check what was committed to, and say how good the
verdicts were.

Nothing here diagnoses or simulates; only this is given the key, and a published file needs none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from r2s2r_cli.blind.code import code
from r2s2r_cli.blind.score.again import same
from r2s2r_cli.blind.score.calibrate import calibrated
from r2s2r_cli.blind.score.cases import Case, case
from r2s2r_cli.blind.score.facts import Said, Truth, said_of, truth_of
from r2s2r_cli.blind.score.follow import resolved
from r2s2r_cli.blind.score.pool import Pool, pooled
from r2s2r_cli.blind.score.published import published, read_published
from r2s2r_cli.blind.score.rows import WITHOUT, row
from r2s2r_cli.blind.score.shard import Judged, Shard, followed, opened
from r2s2r_cli.blind.score.table import score_of
from r2s2r_cli.blind.score.worth import worth
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import InputError
from schemas.results_blind import BlindScoreResult
from schemas.results_blind_worth import BlindWorthResult

__all__ = ["calibration", "calibration_published", "publish", "score", "score_of", "score_published", "worth_published"]


def score(
    bank: Path, verdicts: Path, key: bytes, *, again: Path | None = None, follow: Path | None = None
) -> BlindScoreResult:
    """The table of a bank.

    again: verdicts on the same worlds under other noise (a bank of the same key, made with another `--observed`), to
    be compared. follow: folder of `blind follow`. Raises InputError where a hash is not the published one, the key is
    another, or there is no verdict.
    """
    return _score(pooled([opened(bank, verdicts, key, follow=follow)]), () if again is None else (again,))


def score_published(
    files: Sequence[Path], *, again: Sequence[Path] = (), follow: Path | None = None
) -> BlindScoreResult:
    """The table of published files together. again: published files or folders of verdicts; follow: as in `score`,
    instead of what the files hold. Raises InputError as `read_published` and `pooled` do."""
    shards = [read_published(path) for path in files]
    if follow is not None:
        shards = [_followed(one, follow) for one in shards]
    return _score(pooled(shards), again)


def publish(
    bank: Path, verdicts: Path, key: bytes, *, judged_by: Path | None = None, follow: Path | None = None
) -> bytes:
    """The file of a bank and its verdicts, for `score_published`. judged_by: the checkout whose code judged verdicts
    that do not say so themselves; None: this one. Raises InputError as `score` does."""
    shard = opened(bank, verdicts, key, follow=follow)
    return published(shard, None if shard.code else code(judged_by))


def calibration(bank: Path, verdicts: Path, key: bytes, older: Sequence[Path] = ()) -> dict[str, Any]:
    """What the verdicts on a calibration bank teach about probabilities (`calibrate`). older: published files of
    versions that counted gains in another way; they teach only what the best effect may leave. Raises InputError as
    `score` does, for another bank, and for too few sets."""
    return _calibration(pooled([opened(bank, verdicts, key)]), str(bank), older)


def calibration_published(files: Sequence[Path], older: Sequence[Path] = ()) -> dict[str, Any]:
    """The same of published files together."""
    return _calibration(pooled([read_published(path) for path in files]), ", ".join(map(str, files)), older)


def worth_published(learned: Sequence[Path], judged: Sequence[Path]) -> BlindWorthResult:
    """What each kind of evidence is worth on published files of the blind bank, learned on those of the calibration
    bank. Raises InputError as `calibration_published` does, and where one bank would teach and judge."""
    teaching, pool = (
        pooled([read_published(path) for path in learned]),
        pooled([read_published(path) for path in judged]),
    )
    _must_teach(teaching, ", ".join(map(str, learned)))
    if pool.bank == Bank.CALIBRATION or pool.shuffled:
        raise InputError("what teaches may not judge", where=", ".join(map(str, judged)), expected="the blind bank",
                         received=f"{pool.bank}{', commands exchanged' * pool.shuffled}",
                         hint="r2s2r blind worth docs/blind/blind-b-6.json.gz --learned FILE")  # fmt: skip
    if pool.kept != teaching.kept:
        raise InputError("what teaches and what is judged have different catalogues", where="--learned",
                         expected=_catalogue(pool), received=_catalogue(teaching),
                         hint="r2s2r blind worth docs/blind/blind-b-6.json.gz --learned FILE")  # fmt: skip
    cases = [one for _, one in _cases(teaching)]
    found = _cases(pool)
    return BlindWorthResult(learned=len(cases), judged=len(found), rows=worth(cases, found),
                            warnings=(*teaching.warnings, *pool.warnings))  # fmt: skip


def _catalogue(pool: Pool) -> str:
    return "the whole catalogue" if pool.kept is None else ", ".join(sorted(pool.kept))


def _must_teach(pool: Pool, where: str) -> None:
    if pool.bank != Bank.CALIBRATION or pool.shuffled:
        raise InputError("only a calibration bank may teach anything", where=where, expected="calibration",
                         received=f"{pool.bank}, commands exchanged" if pool.shuffled else pool.bank,
                         hint="r2s2r blind make --bank calibration --count 120 --key cal.key cal")  # fmt: skip
    if any(one.label["kind"] != "none" and one.label["d"] is None for one in pool.sets):
        raise InputError("a set was made without d, by which clear sets are told from faint ones: it would teach that "
                         "nothing is wrong", where=where, expected="d of every set with something wrong",
                         received="a bank made with --no-oracle",
                         hint="r2s2r blind make --bank calibration --count 120 --key cal.key cal")  # fmt: skip


def _cases(pool: Pool) -> list[tuple[Truth, Case]]:
    told = [(truth_of(one.label), one.verdict) for one in pool.sets if not one.verdict["failed"]]
    found = [(truth, case(truth, verdict["diagnosis"])) for truth, verdict in told]
    return [(truth, one) for truth, one in found if one is not None]


def _calibration(pool: Pool, where: str, older: Sequence[Path]) -> dict[str, Any]:
    _must_teach(pool, where)
    cases = [one for _, one in _cases(pool)]
    words = f"{len(cases)} sets of the calibration bank {_banks(pool)}"
    if not older:
        return calibrated(cases, words=words)
    before = pooled([read_published(path) for path in older])
    _must_teach(before, ", ".join(map(str, older)))
    twice = {one.index_sha256 for one in pool.shards} & {one.index_sha256 for one in before.shards}
    if twice:
        raise InputError(
            "a shard teaches twice", where="--older", expected="other shards than those that teach all",
            received=", ".join(sorted(twice)),
            hint="r2s2r blind calibrate --published FILE --older OTHER --out calibration.json",
        )  # fmt: skip
    words = f"{words}; what the best effect may leave from {_banks(before)} too"
    return calibrated(cases, words=words, older=[one for _, one in _cases(before)])


def _banks(pool: Pool) -> str:
    return " + ".join(one.index_sha256[:12] for one in pool.shards)


def _score(pool: Pool, again: Sequence[Path]) -> BlindScoreResult:
    found = [(one.name, *_pair(one)) for one in pool.sets]
    result = score_of(found, tier=pool.tier, bank=pool.bank, sets=pool.total, index=pool.own,
                      warnings=(*pool.warnings, *_unfollowed(pool)), shuffled=pool.shuffled)  # fmt: skip
    rows = list(result.rows)
    if pool.kept is not None:
        named = [(t, replace(s, failed=bool(set(s.named) - pool.kept))) for _, t, s in found]
        rows.append(row(WITHOUT, named, pool.tier))
    if again:
        rows.append(same(pool, found, again))
    return result.model_copy(update={"rows": tuple(rows), "shards": pool.shards})


def _pair(one: Judged) -> tuple[Truth, Said]:
    truth, said = truth_of(one.label), said_of(one.verdict)
    if one.follow is None or said.verdict != "ambiguous":
        return truth, said
    tried = [resolved(truth, one.follow.get(name)) for name in ("suggested", "random")]
    return truth, replace(said, suggested=tried[0], random=tried[1])


def _unfollowed(pool: Pool) -> list[str]:
    """Words where only a part of the ambiguous sets was followed."""
    open_ = [one for one in pool.sets if (one.verdict.get("diagnosis") or {}).get("verdict") == "ambiguous"]
    left = sum(one.follow is None for one in open_)
    if not left or left == len(open_):
        return []
    return [f"{left} of {len(open_)} ambiguous sets were not followed: the others are counted"]


def _followed(shard: Shard, folder: Path) -> Shard:
    sets = tuple(
        replace(one, follow=followed(folder / f"{one.name}.json", shard.own, one.verdict["logs"])) for one in shard.sets
    )
    return replace(shard, sets=sets)

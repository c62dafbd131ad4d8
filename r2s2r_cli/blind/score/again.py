"""The negative control of other noise: verdicts on the same worlds, observed once more."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from r2s2r_cli.blind.score.facts import Said, Truth, said_of
from r2s2r_cli.blind.score.pool import Pool
from r2s2r_cli.blind.score.published import read_published
from r2s2r_cli.blind.score.rows import AGAIN, row
from r2s2r_cli.blind.split import judged
from r2s2r_cli.blind.verdict import read_verdict
from r2s2r_cli.errors import InputError
from schemas.results_blind import BlindRow

_GAIT = re.compile(r"g(\d+)(?::|$)")
"""Runs of a set: g1, g2, ..., and intervals of them: g1:4."""
_MAKE = "r2s2r blind make --observed 1 --key SAME.key again"


def same(pool: Pool, found: Sequence[tuple[str, Truth, Said]], again: Sequence[Path]) -> BlindRow:
    """How often other noise on the same world leaves the verdict as it is.

    again: folders of `blind run`, or published files. Raises InputError where none of them knows a set of the pool, or
    where one of them has another world under its name, as far as that shows.
    """
    labels = {one.name: one.label for one in pool.sets}
    others: dict[str, Mapping[str, Any]] = {}
    for path in again:
        others |= _verdicts(path, labels)
    pairs = []
    for name, truth, said in found:
        if name in others:
            other = said_of(dict(others[name]))
            pairs.append((truth, replace(said, failed=(said.verdict, said.named) != (other.verdict, other.named))))
    if not pairs:
        raise InputError("there is no second verdict on any of these sets", where=", ".join(map(str, again)),
                         expected="verdicts on a bank of the same key, made with --observed 1", received="none",
                         hint=_MAKE)  # fmt: skip
    return row(AGAIN, pairs, pool.tier)


def _require_its_gaits(verdict: Mapping[str, Any], label: Mapping[str, Any], *, where: str) -> None:
    """Names of sets come from the key alone, worlds from what `make` was asked as well, above all from --count. A
    verdict does not know its world; but it names gaits that the set does not have, or none of those that it is judged
    on."""
    document = verdict.get("diagnosis") or {}
    on = (document.get("shrinkage") or {}).get("judged_on") or ()
    runs = [*on, *(str(one.get("run")) for one in document.get("segments") or ())]
    seen = max((int(found[1]) for found in map(_GAIT.match, runs) if found), default=0)
    has = int(label["gaits"])
    if seen > has or (on and seen <= has - judged(has)):
        raise InputError("a second verdict is on another world than the first", where=where,
                         expected=f"a set of {has} gaits", received=f"one of {seen}",
                         hint=f"{_MAKE}   # all else as before")  # fmt: skip


def _verdicts(path: Path, labels: Mapping[str, dict[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Second verdicts by name: of a folder of `blind run`, or of a published file, whose worlds can be compared."""
    found: dict[str, Mapping[str, Any]] = {}
    if not path.is_file():
        for name, label in labels.items():
            if (there := path / f"{name}.json").exists():
                found[name] = read_verdict(there)
                _require_its_gaits(found[name], label, where=str(there))
        return found
    for one in read_published(path).sets:
        if one.name in labels:
            mine, other = (which.get("seed") for which in (labels[one.name], one.label))
            if mine != other:
                raise InputError("two sets of one name are of different worlds", where=f"{path}: {one.name}",
                                 expected=f"seed {mine}", received=f"seed {other}",
                                 hint=_MAKE)  # fmt: skip
            found[one.name] = one.verdict
    return found

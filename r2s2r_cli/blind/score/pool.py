"""Shards put together: banks of one tier and kind, each committed to before its own verdicts, asked the same."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from r2s2r_cli.blind.score.shard import Judged, Shard
from r2s2r_cli.errors import InputError
from schemas.results_blind import BlindShard

_LISTED = 3


@dataclass(frozen=True)
class Pool:
    """sets: of all shards, by name. own: their lists' hashes, in the order of the hashes. total: sets of the banks,
    judged or not."""

    sets: tuple[Judged, ...]
    tier: Any
    bank: str
    asked: dict[str, Any]
    total: int
    shards: tuple[BlindShard, ...]
    warnings: tuple[str, ...]

    @property
    def own(self) -> str:
        """What was committed to, of every shard."""
        return " + ".join(one.index_sha256 for one in self.shards)

    @property
    def shuffled(self) -> bool:
        """A negative control, in which nothing is true."""
        return self.asked["shuffled"] is not None

    @property
    def kept(self) -> frozenset[str] | None:
        """The catalogue that was asked for; None: the whole of it."""
        effects = self.asked["settings"].get("effects")
        return None if effects is None else frozenset(map(str, effects))


def pooled(shards: Sequence[Shard]) -> Pool:
    """One or several. Raises InputError where a set or a world is in two, or where they differ in tier, bank or what
    was asked."""
    shards = sorted(shards, key=lambda one: one.own)
    _alike(shards, "are of different tiers", lambda one: str(one.index["tier"]))
    _alike(shards, "are of different banks", lambda one: str(one.index["bank"]))
    _alike(shards, "answer different questions", lambda one: json.dumps(one.asked, sort_keys=True))
    _apart(shards)
    found = sorted((one for shard in shards for one in shard.sets), key=lambda one: one.name)
    first = shards[0]
    return Pool(
        sets=tuple(found), tier=first.index["tier"], bank=first.index["bank"], asked=first.asked,
        total=sum(len(one.index["sets"]) for one in shards), shards=tuple(map(_facts, shards)),
        warnings=tuple(_warnings(shards)),
    )  # fmt: skip


def _alike(shards: Sequence[Shard], what: str, of: Callable[[Shard], str]) -> None:
    first = shards[0]
    for one in shards[1:]:
        if of(one) != of(first):
            raise InputError(f"these shards {what}", where=f"{first.where}, {one.where}", expected=of(first),
                             received=of(one), hint=f"r2s2r blind score --published {first.where}")  # fmt: skip


def _apart(shards: Sequence[Shard]) -> None:
    """Names come from key and number: two shards of one key have the same names for other worlds. Other noise on a
    world makes no other world: two such sets are no two trials."""
    there: dict[object, str] = {}
    for shard in shards:
        for one in shard.sets:
            seed = one.label.get("seed")
            world = one.name if seed is None else seed
            if world in there:
                where = there[world]
                raise InputError(
                    "one world would be counted twice", where=f"{where}, {shard.where}: {one.name}",
                    expected="shards made each with its own key and, of a calibration bank, its own --first",
                    received="the same file twice" if where == shard.where else f"set {one.name} in both",
                    hint=f"r2s2r blind score --published {where}",
                )  # fmt: skip
            there[world] = shard.where


def _facts(shard: Shard) -> BlindShard:
    return BlindShard(where=shard.where, index_sha256=shard.own, sets=len(shard.index["sets"]), scored=len(shard.sets),
                      commits=tuple(dict.fromkeys(str(one["commit"]) for one in shard.code if one["commit"])),
                      sources_sha256=tuple(dict.fromkeys(str(one["sources_sha256"]) for one in shard.code)),
                      makers_sha256=tuple(str(one["sources_sha256"]) for one in _makers(shard)),
                      calibrated=shard.calibrated)  # fmt: skip


def _makers(shard: Shard) -> list[dict[str, Any]]:
    """What made the bank, as its list says; those of versions before say nothing."""
    return list(shard.index.get("makers", ()))


def _warnings(shards: Sequence[Shard]) -> list[str]:
    found = []
    missing = sum(len(one.missing) for one in shards)
    if missing:
        found.append(f"{missing} sets have no verdict: only the others are counted")
    judges = [one for shard in shards for one in shard.code]
    if len({one["sources_sha256"] for one in judges}) > 1:
        commits = dict.fromkeys(str(one["commit"] or "no checkout")[:12] for one in judges)
        found.append(f"different code judged these sets ({', '.join(commits)}): one figure mixes it")
    if any(one["changed"] for one in judges):
        found.append("sets were judged from a checkout with changes that were not committed")
    makers = [one for shard in shards for one in _makers(shard)]
    if len({one["sources_sha256"] for one in makers}) > 1:
        commits = dict.fromkeys(str(one["commit"] or "no checkout")[:12] for one in makers)
        found.append(f"different code made these banks ({', '.join(commits)}): logs, and labels such as d, may be "
                     "defined otherwise")  # fmt: skip
    silent = [one.where for one in shards if not one.code]
    if silent and len(silent) < len(shards):
        found.append(f"which code judged is not known of {', '.join(silent)}")
    learned = sorted({words for one in shards for words in one.calibrated})
    if len(learned) > 1:
        found.append(f"probabilities come from {len(learned)} calibrations ({'; '.join(learned[:_LISTED])})")
    return found

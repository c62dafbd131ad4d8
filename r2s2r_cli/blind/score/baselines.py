"""Diagnosers that look at nothing, scored on the labels of the trial: what a figure is worth beside them.

One guesses at random among all names, with an element, a place and an onset of another set. The others know how often
each name is right in this very bank, which nobody could, and always say the same, with the middle of the floor, where
every run begins, as the place.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from r2s2r_cli.blind.score.facts import NONE, UNKNOWN, Said, Truth
from r2s2r_cli.blind.score.rows import METRICS, Pair, calibration_error, coverage, row
from schemas.results_blind import BlindBaseline, Tier

DRAWS = 20
"""Guesses a set, of the one who guesses."""
HELD = 0.90
MIDDLE = (0.0, 0.0)
T = TypeVar("T", bound=Hashable)


def baselines(pairs: Sequence[Pair], tier: Tier) -> tuple[BlindBaseline, ...]:
    """At random; always the most frequent right answer; always the most frequent effect, where that is another."""
    truths = [t for t, _ in pairs]
    ranked = {name for _, s in pairs for name in s.order}
    names = sorted(ranked | {name for t in truths for name in t.effects} | {NONE, UNKNOWN})
    rng = np.random.default_rng(0)
    told = [t for t in truths if t.channel is not None]
    guessed = [(t, _guess(names, told, rng)) for t in truths for _ in range(DRAWS)]
    found = [_values("at random", guessed, tier)]
    often = Counter(t.right for t in truths if t.right is not None)
    order = sorted(often, key=lambda name: (-often[name], name))
    effects = [name for name in order if name not in (NONE, UNKNOWN)]
    for first in dict.fromkeys([*order[:1], *effects[:1]]):
        said = _always([first, *(name for name in order if name != first)], often, told)
        found.append(_values(f"always {first}", [(t, said) for t in truths], tier))
    return tuple(found)


def _values(name: str, pairs: Sequence[Pair], tier: Tier) -> BlindBaseline:
    rows = [*(row(metric, pairs, tier) for metric in METRICS), coverage(pairs, tier), calibration_error(pairs, tier)]
    return BlindBaseline(name=name, values={one.name: one.value for one in rows if one.value is not None})


def _guess(names: Sequence[str], told: Sequence[Truth], rng: np.random.Generator) -> Said:
    """Every order of names as likely as any other; where: of one of the sets."""
    order = tuple(str(name) for name in rng.permutation(names))
    held = order[: math.ceil(HELD * len(order))]
    where = told[int(rng.integers(len(told)))] if told else None
    return _said(order, (1.0 / len(order),) * len(order), held, where.channel if where else None,
                 _element(where), where.onset["of_set"] if where and where.onset else None)  # fmt: skip


def _always(order: Sequence[str], often: Counter[str], told: Sequence[Truth]) -> Said:
    """The first name, as probable as it is frequent, with the most frequent channel, element and onset."""
    total = often.total()
    share = [often[name] / total for name in order]
    within = int(np.searchsorted(np.cumsum(share), HELD)) + 1
    elements = [(one["kind"], one["index"]) for t in told if (one := t.element) is not None]
    most = _most(elements)
    return _said(tuple(order), tuple(share), tuple(order[:within]), _most(t.channel for t in told),
                 {"xy_m": MIDDLE} if most is None else {"kind": most[0], "index": most[1], "xy_m": MIDDLE},
                 _most(int(t.onset["of_set"]) for t in told if t.onset is not None))  # fmt: skip


def _said(
    order: tuple[str, ...], p: tuple[float, ...], held: tuple[str, ...], channel: str | None,
    element: dict[str, Any] | None, onset: int | None,
) -> Said:  # fmt: skip
    verdict = {NONE: "no_gap", UNKNOWN: "unknown"}.get(order[0], "effect")
    named = order[:1] if verdict == "effect" else ()
    return Said(verdict=verdict, named=named, order=order, probability=p, set90=held, channel=channel, element=element,
                onset=onset, own_share=None, predicted=None, failed=False)  # fmt: skip


def _element(one: Truth | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {**(one.element or {}), "xy_m": one.place} if one.element or one.place else None


def _most(values: Iterable[T | None]) -> T | None:
    """The most frequent one; of equal ones the first by its text."""
    count = Counter(value for value in values if value is not None)
    return min(count, key=lambda value: (-count[value], str(value)), default=None)

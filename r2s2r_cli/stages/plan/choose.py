"""From all gaits of the search to the ten best of every behaviour."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.import_.run import RUN_NAME
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import Gait
from r2s2r_cli.stages.plan.placement import Reference
from r2s2r_cli.stages.plan.rewards import Outcomes, Reward
from r2s2r_cli.stages.plan.robust import Primitive, arrived, earned, judged, primitive
from r2s2r_cli.stages.plan.search import Found, best_of
from r2s2r_cli.stages.plan.standing import Standing, stacked


@dataclass(frozen=True)
class ChoiceSettings:
    """first_pairs: on which all of the shortlist are judged; `finalists` of them are on all pairs; kept: how many stay.
    spread: standard deviations that are taken off the mean."""

    first_pairs: int = 6
    finalists: int = 20
    kept: int = 10
    spread: float = 1.0


class Judge:
    """Outcomes of gaits over pairs of numbers and start poses; a gait is simulated once, whatever asks for it."""

    def __init__(self, executor: Executor, reference: Reference, pairs: Standing, rest_error_m: float) -> None:
        self.executor, self.reference, self.pairs, self.rest_error_m = executor, reference, pairs, rest_error_m
        self._known: dict[tuple[tuple[str, ...], int], tuple[Outcomes, np.ndarray]] = {}
        self.simulated = 0

    def also_from(self, more: Standing) -> None:
        """Judge gaits from these robots as well from now on."""
        self.pairs = stacked([self.pairs, more])
        self._known.clear()

    def __call__(self, gaits: list[Gait], count: int) -> list[tuple[Outcomes, np.ndarray]]:
        """Outcomes and whether the gait came back to rest, over `count` pairs spread evenly, the first included."""
        rows = np.unique(np.round(np.linspace(0, len(self.pairs) - 1, count)).astype(int))
        new = list({gait.key: gait for gait in gaits if (gait.key, count) not in self._known}.values())
        if new:
            for gait, (came, sound) in zip(
                new, judged(self.executor, self.reference, self.pairs, new, rows), strict=True
            ):
                self._known[gait.key, count] = came, sound & (came.error < self.rest_error_m)
                self.simulated += len(rows) * len(gait.targets)
        return [self._known[gait.key, count] for gait in gaits]


SHORTER = 4
"""One of so many gaits on the shortlist has fewer shapes than others may have: what is short is mostly steady."""


def shortlist(found: Found, rewards: Mapping[str, Reward], count: int) -> dict[str, list[Gait]]:
    """The gaits of the search with the highest rewards of every behaviour; a quarter of them short ones."""
    deepest = max((len(gait.targets) for gait in found.gaits), default=0)
    short = np.array([k for k, gait in enumerate(found.gaits) if len(gait.targets) < deepest], dtype=int)
    fewer = replace(found, gaits=[found.gaits[k] for k in short], outcomes=found.outcomes.take(short))
    listed = {}
    for name, reward in rewards.items():
        of_short = [fewer.gaits[row] for row in best_of(fewer, reward, count // SHORTER)] if len(short) else []
        every = [found.gaits[row] for row in best_of(found, reward, count - len(of_short))]
        listed[name] = list({gait.key: gait for gait in every + of_short}.values())
    return listed


def short_names(behaviours: Iterable[str]) -> dict[str, str]:
    """What gaits of each behaviour are called: the last word of `package.module:function`, and as many words before it
    as tell it from the others; one word is called as it is. Raises UsageError where no policy may be called so."""
    parts = {name: re.split(r"[.:]", name) for name in behaviours}
    found: dict[str, str] = {}
    for name, words in parts.items():
        taken = [other for key, other in parts.items() if key != name]
        count = next((n for n in range(1, len(words)) if all(other[-n:] != words[-n:] for other in taken)), len(words))
        found[name] = "-".join(words[-count:])
        if not re.fullmatch(RUN_NAME, found[name]):
            raise UsageError(
                "gaits cannot be named after this behaviour", where=f"--behaviour {name}", received=found[name],
                expected="a name that begins with a letter or digit; letters, digits, _ . + -",
                hint="--behaviour forward",
            )  # fmt: skip
    return found


def chosen(
    judge: Judge, listed: Mapping[str, list[Gait]], rewards: Mapping[str, Reward], settings: ChoiceSettings,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, tuple[Primitive, ...]]:  # fmt: skip
    """The best gaits of every behaviour, best first, by their robust score; named `forward-1`, `forward-2` ..., as
    `short_names` calls the behaviour."""
    few = min(settings.first_pairs, len(judge.pairs))
    finalists: dict[str, list[Gait]] = {}
    for number, (behaviour, reward) in enumerate(rewards.items()):
        gaits = listed[behaviour]
        first = [earned(reward, came, good) for came, good in judge(gaits, few)]
        order = np.argsort([-(one.mean() - settings.spread * one.std()) for one in first], kind="stable")
        finalists[behaviour] = [gaits[k] for k in order[: settings.finalists]]
        progress(number + 1, 2 * len(rewards))
    # Within a sequence a gait starts where another ended: from there as well it has to work.
    leading = [gaits[0] for gaits in finalists.values() if gaits]
    judge.also_from(arrived(judge.executor, judge.reference, judge.pairs, leading, judge.rest_error_m))
    kept: dict[str, tuple[Primitive, ...]] = {}
    short = short_names(rewards)
    for number, (behaviour, reward) in enumerate(rewards.items()):
        gaits = finalists[behaviour]
        made = [
            primitive("", behaviour, reward, gait, came, good, spread=settings.spread)
            for gait, (came, good) in zip(gaits, judge(gaits, len(judge.pairs)), strict=True)
        ]
        ranked = sorted(made, key=lambda one: (-one.score, one.gait.key))[: settings.kept]
        kept[behaviour] = tuple(replace(one, name=f"{short[behaviour]}-{k}") for k, one in enumerate(ranked, 1))
        progress(len(rewards) + number + 1, 2 * len(rewards))
    return kept

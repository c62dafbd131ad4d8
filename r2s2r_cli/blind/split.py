"""Which sets belong to which bank: seeds, sizes of effects, composition. The only place where the banks differ."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from r2s2r_cli.errors import UsageError


class Bank(StrEnum):
    """What a set is for."""

    CALIBRATION = "calibration"
    """Thresholds and the temperature are set on these; anybody may look at their labels."""
    BLIND = "blind"
    """The published figures. Made after everything is frozen, opened by `score` alone."""
    REGRESSION = "regression"
    """A few with fixed seeds for the test suite: no evidence of anything."""


class Kind(StrEnum):
    """What is wrong in a world."""

    NONE = "none"
    SINGLE = "single"
    PAIR = "pair"
    OUTSIDE = "outside"
    """Something that no catalogue has."""


@dataclass(frozen=True)
class Range:
    """seeds: of the sets. low, high: sizes of effects as factors of their usual size, drawn evenly in the logarithm;
    loud: the least one under LOUD_M of noise. faint: the same of a part FAINT of the sets, most of whose effects lie
    under the floor; None: there is no such part.
    """

    seeds: range
    low: float
    high: float
    loud: float
    faint: tuple[float, float] | None = None


RANGES = {
    Bank.CALIBRATION: Range(range(100_000, 200_000), 0.5, 1.6, 0.8, (0.0025, 0.025)),
    Bank.BLIND: Range(range(500_000, 900_000), 0.45, 1.8, 0.75, (0.002, 0.03)),
    Bank.REGRESSION: Range(range(1_000, 2_000), 0.8, 1.3, 0.8),
}
FAINT = 0.25
LOUD_M = 0.010
"""Of noise, where the floor is two to four times that of less: effects below half of it say nothing, and are not drawn
(the catalogue is of sizes from half a floor on), but for the faint ones."""
SHARES = {Kind.NONE: 0.15, Kind.SINGLE: 0.60, Kind.PAIR: 0.10, Kind.OUTSIDE: 0.15}
NOISE_M = (0.002, 0.005, 0.010)
AR1 = (0.0, 0.7)
RATES_HZ = (10.0, 30.0)
GAITS = (3, 5, 8)
TARGETS = 5
"""Of a gait."""
JUDGED = 3
"""Of so many gaits one is judged on, the last ones; the others are fitted."""
FOLLOW = "follow"
"""Folder in a set of what was run after its gaits, because of their verdict (`blind follow`)."""


def judged(gaits: int) -> int:
    """How many of the gaits of a set are judged on: what begins in one of these nobody could have learned of."""
    return max(1, round(gaits / JUDGED))


def seeds(bank: Bank, count: int, first: int = 0) -> range:
    """Seeds of the sets first, first + 1, ... of a bank. Raises UsageError where the bank has no more."""
    whole = RANGES[bank].seeds
    if first < 0 or count < 1 or first + count > len(whole):
        raise UsageError(
            f"the bank {bank} has no such sets", where="--count", expected=f"1 to {len(whole) - max(first, 0)}",
            received=f"{count} from {first}", hint="r2s2r blind make --count 24",
        )  # fmt: skip
    return whole[first : first + count]


def kinds(count: int, rng: np.random.Generator) -> list[Kind]:
    """Kinds of `count` sets in random order, shares as near `SHARES` as whole numbers allow."""
    wanted = {kind: share * count for kind, share in SHARES.items()}
    whole = {kind: int(value) for kind, value in wanted.items()}
    order = sorted(wanted, key=lambda kind: whole[kind] - wanted[kind])
    for kind in order[: count - sum(whole.values())]:
        whole[kind] += 1
    found = [kind for kind, number in whole.items() for _ in range(number)]
    return [found[i] for i in rng.permutation(count)]


def size(bank: Bank, rng: np.random.Generator, noise_m: float) -> float:
    """A size, as a factor of the usual one: off every grid. noise_m: of the set [m]."""
    of = RANGES[bank]
    faint = rng.random() < FAINT
    plain = (of.loud if noise_m >= LOUD_M else of.low, of.high)
    low, high = of.faint if faint and of.faint is not None else plain
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))

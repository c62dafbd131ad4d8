"""How probable it is that two effects are there, and what that makes of the probabilities of their names.

A pair is a hypothesis beside the single effects: as probable as its first effect alone where the second adds just as
much as it must, exponentially more or less so beyond. What it adds is the less of what it adds on left-out gaits and on
all data. One law is never quite right and a second mends its faults, the more the larger the first is, so what it must
add grows with that. What speaks for a pair is shared by its two names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

LEAST = 15.0
"""[nats] beyond chance that a second effect must add."""
SHARE = 0.2
"""Of the first effect's gain, which it must add as well: in 22 calibration sets with one cause that gained 30 nats or
more second effects added 0.22 of it at most but for one fit that had stopped early, in three with two causes 0.48 to
1.5 (`calibration-9`)."""
SLACK = 20.0
"""[nats] by which what it adds must differ from that for the odds to change by a factor e: what second laws add
where one effect is there differs from set to set by more than gains do."""
LARGEST = 60.0
"""Of an exponent."""


@dataclass(frozen=True)
class TwoCauses:
    """Two effects fitted together, the better single one first. gain: held out, over the refit nominal model: what the
    first one alone gains and what the second adds, at most ENOUGH_OF_TWO a piece [nats]; marginal: the same on all
    data, where all of it counts [nats]; added: the less of what the second one adds to both."""

    effects: tuple[str, str]
    gain: float
    marginal: float
    added: float


def with_pairs(
    probability: Mapping[str, float], pairs: Sequence[TwoCauses], alone: Mapping[str, float], chance: float,
) -> tuple[dict[str, float], tuple[str, str] | None]:  # fmt: skip
    """Probabilities of names once pairs are possible, and the pair that is likelier than its first effect alone, None
    for none. alone: held-out gains of single effects, bounded as those of pairs [nats]; chance: what the best of the
    catalogue gains by chance [nats]."""
    found, believed = dict(probability), None
    best = 0.0
    for pair in pairs:
        first, second = pair.effects
        if first not in probability or second not in probability:
            continue
        needed = chance + LEAST + SHARE * max(alone.get(first, 0.0), 0.0)
        beyond = (pair.added - needed) / SLACK
        both = probability[first] * float(np.exp(min(beyond, LARGEST)))
        found[first] += both / 2
        found[second] += both / 2
        if beyond > 0.0 and both > best:
            best, believed = both, pair.effects
    total = sum(found.values()) / max(sum(probability.values()), 1e-12)
    return {name: value / total for name, value in found.items()}, believed

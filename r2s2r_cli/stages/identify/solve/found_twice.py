"""Cooling over growing horizons, again and again until the best cost is found twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from r2s2r_cli.stages.identify.solve.loss import Loss
from r2s2r_cli.stages.identify.solve.population import Cooled, Cooling, Population, cool

AGREE = 3.0
"""[nats] Costs of two ways that ended in the same place, or in one as likely."""
EASY = 8
"""A first way that took at most so many generations at the end, and was not rough there, needs no second."""
ROUGH = 1.3
"""Temperature of the last draw beyond which a cost is rough on the scale of its own standard deviations."""
HOTTER = 1.5
"""Each way begins so much hotter than the one before."""
COOLING = Cooling()
MORE = 16
"""Candidates more in a generation of a later way: the problem has shown that it is not easy."""
CHANCES = 6
"""Ways, at most."""
MANY_CHANCES = 10
"""The same with many unknowns, as those of a start."""


@dataclass(frozen=True)
class Ways:
    """best: where the best way ended. others: unknowns (n,) at the ends of those that are about as good; where none is,
    of the next best: nothing shows then that the best is right. costs: of all ways at the end."""

    best: Cooled
    others: tuple[np.ndarray, ...]
    costs: tuple[float, ...]

    @property
    def twice(self) -> bool:
        """Whether a second way ended at about the best cost."""
        return len(self.costs) > 1 and sorted(self.costs)[1] < self.best.cost + AGREE


@dataclass(frozen=True)
class Begin:
    """Where a way begins: unknowns z (n,), curvature there, normal (n, n) with priors, and the number of its stage."""

    z: np.ndarray
    normal: np.ndarray
    stage: int = 0


def cool_growing(
    stages: Sequence[Population],
    begins: Sequence[Begin],
    *,
    loss: Loss,
    seed: int = 0,
    cooling: Cooling = COOLING,
    chances: int = CHANCES,
    told: Callable[[int, int, int, float], None] | None = None,
) -> Ways:
    """Cool each of the stages, problems over the same unknowns, short horizon first, from the one before.

    A cost that is rough has minima beside the best; which one a way ends in is chance. So ways are begun anew, from
    each of `begins` in turn, with other draws until two end within `AGREE` of the best, at most `chances`; unless the
    first was `EASY`. told is called with the numbers of the way, the stage and the generation, and the cost. Raises as
    `cool`.
    """
    ends: list[Cooled] = []
    for chance in range(chances):
        begin = begins[chance % len(begins)]
        z, curvature = begin.z, begin.normal
        for number in range(begin.stage, len(stages)):
            members = cooling.members + (MORE if chance else 0)
            own = replace(cooling, members=members, hottest=cooling.hottest * HOTTER**chance)
            heard = None if told is None else partial(told, chance, number)
            own_seed = 1000 * seed + 100 * chance + number
            at = cool(stages[number], z, curvature, loss=loss, seed=own_seed, cooling=own, told=heard)
            z, curvature = at.z, at.normal
        ends.append(at)
        best, *rest = sorted(ends, key=lambda one: one.cost)
        close = [one for one in rest if one.cost < best.cost + AGREE] or rest[:1]
        ways = Ways(best, tuple(one.z for one in close), tuple(one.cost for one in ends))
        easy = chance == 0 and at.generations <= EASY and at.rough <= ROUGH
        if easy or ways.twice:
            break
    return ways

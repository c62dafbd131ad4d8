"""Does the simulator rank gaits as the robot does: Spearman's rank correlation over policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.repeats import ended, turned
from r2s2r_cli.stages.compare.walk import Walk

LEAST = 4
"""Gaits below which a rank correlation says nothing: of three, one order in six is perfect by chance."""


@dataclass(frozen=True)
class Ranking:
    """Spearman's rank correlation of real and simulated gaits. com: of how far the centre of mass came; turn: of how
    far the robot turned; None where they have no headings, or all are equal. gaits: number of policies."""

    gaits: int
    com: float | None
    turn: float | None


def ranking(real: Mapping[str, Walk], simulated: Mapping[str, Walk], policies: Mapping[str, str]) -> Ranking | None:
    """Over the policies of the runs, repeats averaged; None for fewer than LEAST policies.

    Simulation-to-reality correlation coefficient in the sense of Koos, Mouret and Doncieux (IEEE Trans. Evol. Comput.
    17 (2013) 122) and Kadian et al. (IEEE RA-L 5 (2020) 6670), with ranks, for gaits are chosen by rank.
    """
    names = list(dict.fromkeys(policies[run] for run in real))
    if len(names) < LEAST:
        return None
    both = [[_of_policy(walks, policies, name) for name in names] for walks in (real, simulated)]
    com = _spearman([one[0] for one in both[0]], [one[0] for one in both[1]])
    turns = [[one[1] for one in side] for side in both]
    known = all(value is not None for side in turns for value in side)
    turn = _spearman(turns[0], turns[1]) if known else None  # type: ignore[arg-type]
    return Ranking(len(names), com, turn)


def _of_policy(walks: Mapping[str, Walk], policies: Mapping[str, str], name: str) -> tuple[float, float | None]:
    """Way of the centre of mass [m] and turn [rad], means over the runs of a policy."""
    mine = [walk for run, walk in walks.items() if policies[run] == name]
    turns = [turned(walk) for walk in mine]
    far = float(np.mean([np.linalg.norm(ended(walk)) for walk in mine]))
    known = [one for one in turns if one is not None]
    return far, float(np.mean(known)) if len(known) == len(turns) else None


def _spearman(one: Sequence[float], other: Sequence[float]) -> float | None:
    from scipy.stats import rankdata

    a, b = rankdata(one), rankdata(other)
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    return float(np.corrcoef(a, b)[0, 1])

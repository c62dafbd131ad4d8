"""Does the simulator rank gaits as the robot does: Spearman's rank correlation over policies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.repeats import ended, turned
from r2s2r_cli.stages.compare.walk import Walk

STILL_M, STILL_RAD = 1e-3, 1e-3
"""Ways and turns are rounded to these: what lies in one step has no order, which noise would make up."""
LEAST = 4
"""Gaits below which a rank correlation says nothing: of three, one order in six is perfect by chance."""


@dataclass(frozen=True)
class Ranking:
    """Spearman's rank correlation of real and simulated gaits.

    com: of how far the centre of mass came along the line on which the real gaits differ most, forth and back told
    apart; turn: of how far the robot turned; None where they have no headings, or all are equal. gaits: of policies."""

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
    ends = [np.array([one[0] for one in side]) for side in both]
    line = np.linalg.svd(ends[0] - ends[0].mean(axis=0))[2][0]
    com = _spearman(_coarse(ends[0] @ line, STILL_M), _coarse(ends[1] @ line, STILL_M))
    turns = [[one[1] for one in side] for side in both]
    known = all(value is not None for side in turns for value in side)
    turn = _spearman(*(_coarse(np.array(side, dtype=float), STILL_RAD) for side in turns)) if known else None
    return Ranking(len(names), com, turn)


def _of_policy(walks: Mapping[str, Walk], policies: Mapping[str, str], name: str) -> tuple[np.ndarray, float | None]:
    """End of the centre of mass (2,) [m] and turn [rad], means over the runs of a policy."""
    mine = [walk for run, walk in walks.items() if policies[run] == name]
    turns = [turned(walk) for walk in mine]
    far = np.mean([ended(walk) for walk in mine], axis=0)
    known = [one for one in turns if one is not None]
    return far, float(np.mean(known)) if len(known) == len(turns) else None


def _coarse(values: np.ndarray, step: float) -> np.ndarray:
    """Rounded to what is no difference: gaits that do not turn have no order."""
    return np.round(values / step)


def _spearman(one: np.ndarray, other: np.ndarray) -> float | None:
    from scipy.stats import rankdata

    a, b = rankdata(one), rankdata(other)
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    return float(np.corrcoef(a, b)[0, 1])

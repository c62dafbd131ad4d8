"""Beside the named effects: that nothing is wrong, how large something without a name may be, and how far chance
carries the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.screen import Response
from r2s2r_cli.stages.measures.bootstrap import upper_bound
from r2s2r_cli.stages.measures.gap import counting, no_gap as at_floor

LEVELS = (0.99, 0.975, 0.95, 0.9, 0.8, 0.7, 0.6)
"""Of confidence that are told apart."""
WIDER = (1.25, 1.5, 2.0, 3.0, 5.0, 8.0)
"""Factors on the floor: how large an error without a name may be."""
DRAWS = 1000


@dataclass(frozen=True)
class NoGap:
    """The equivalence test. rmse: of the refit model at the ends of stretches left out [m]; upper: its upper 90 %
    bound, None for fewer than two stretches; floor [m]; equivalent: the bound is below 1.25 floor. sure: confidence of
    the largest bound that still is, 0 to 1. kept: share of the stretches, the best ones, that all
    of this is of."""

    rmse: float
    upper: float | None
    floor: float
    sure: float = 0.0
    kept: float = 1.0

    @property
    def equivalent(self) -> bool:
        """Whether there is no gap above the floor. Not found is not absent: this is a claim of its own."""
        return self.upper is not None and at_floor(self.upper, self.floor)


def no_gap(refit: Score, floor_m: float, *, kept: float = 1.0) -> NoGap:
    """Of the refit nominal model. kept: share of the intervals, the best ones, that the floor was taken from: the same
    share counts here. An interval that is lost is one of the worst, and counts among them (`Score.squared`)."""
    squared = refit.squared
    squared = squared[counting(squared, kept)] if len(squared) else squared
    rmse = float(np.sqrt(squared.mean())) if len(squared) else float("inf")
    bound = upper_bound(squared, level=0.90) if len(squared) else None
    return NoGap(rmse, bound, floor_m, 0.0 if bound is None else _sure(squared, floor_m), kept)


def _sure(squared: np.ndarray, floor_m: float) -> float:
    """The largest of LEVELS at which the upper bound of the root mean square is at the floor, 0 for none."""
    for level in LEVELS:
        bound = upper_bound(squared, level=level)
        if bound is not None and at_floor(bound, floor_m):
            return level
    return 0.0


def chance(
    arena: Arena, responses: Sequence[Response], groups: np.ndarray, *, level: float = 0.95, seed: int = 0
) -> float:
    """What the best of all candidates gains in held-out density by chance alone, at most, with this probability [nats].

    The parametric bootstrap of the linearised problem: white residuals are drawn, every candidate has one direction,
    and its length is fitted without a group and judged on it.
    """
    known = [one for one in responses if one.testable]
    if not known:
        return 0.0
    names = np.unique(groups)
    grams = []
    for name in names:
        rows = np.concatenate([
            np.arange(kind.rows.start, kind.rows.stop)
            for k in np.flatnonzero(groups == name) for kind in arena.white[k].kinds
        ])  # fmt: skip
        D = np.stack([one.direction[rows] for one in known], axis=1).astype(float)
        grams.append(D.T @ D)
    rng = np.random.default_rng(seed)
    drawn, length = [], []
    for gram in grams:
        value, vector = np.linalg.eigh(gram)
        root = vector * np.sqrt(np.maximum(value, 0.0))
        drawn.append(rng.standard_normal((DRAWS, len(known))) @ root.T)
        length.append(np.diag(gram))
    b, G = np.array(drawn), np.array(length)  # (group, draw, candidate), (group, candidate)
    size2 = np.array([one.seen**2 * max(1.0 - one.absorbed, 1e-9) for one in known])
    prior = 1.0 / np.maximum(size2, 1e-9)
    gain = np.zeros((DRAWS, len(known)))
    for g in range(len(names)):
        without = G.sum(axis=0) - G[g] + prior
        a = (b.sum(axis=0) - b[g]) / without
        left = b[g] - a * G[g]
        gain += a * b[g] - 0.5 * a**2 * G[g] + 0.5 * left**2 / (without + G[g]) - 0.5 * np.log1p(G[g] / without)
    return float(np.quantile(gain.max(axis=1), level))

"""Shrinkage on judged intervals: stale nominal, refit, refit + effect, and a black box that may do anything.

A robot that tips over at another instant than its simulator ends decimetres away, and one such interval outweighs all
others in a mean of squares. A floor that was measured without the worst intervals of the healthy robot is compared with
errors without the worst ones as well: the same share of them, by the larger error of both models (ADR 14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.measures.bootstrap import DRAWS
from r2s2r_cli.stages.measures.gap import corrected_gap, counting, own_share

LEVEL = 0.90


@dataclass(frozen=True)
class Shrinkage:
    """Key-frame cap RMSE [m] over judged segments, each from its own causal start by command replay.

    names: of the judged segments, `RUN:3`; squared: by model (nominal, refit, effect, ceiling), mean squared 3-D
    distance of the caps (segment,) [m^2]. effects: whose effect it is, best guess where nothing was committed to.
    share: own share of the effect, None at the floor; ci90 by bootstrap over segments; predicted, predicted_ci90: what
    it will be, and where, from the targets of the judged intervals and the errors of fitted ones, each with numbers
    fitted without its gait, before the judged ones were looked at (`foretold`). within_run: judged segments share their
    run with fitted ones. kept: share of the segments that count, the best ones, as in the floor.
    """

    effects: tuple[str, ...]
    names: tuple[str, ...]
    squared: dict[str, np.ndarray]
    floor: float
    share: float | None
    ci90: tuple[float, float] | None
    predicted: float | None
    predicted_ci90: tuple[float, float] | None
    within_run: bool
    missing: tuple[str, ...] = ()
    kept: float = 1.0

    @property
    def counts(self) -> np.ndarray:
        """Which segments count, (segment,)."""
        models = [self.squared[name] for name in ("refit", "effect") if name in self.squared]
        return counting(np.max(models, axis=0), self.kept) if models else np.ones(len(self.names), dtype=bool)

    @property
    def set_aside(self) -> tuple[str, ...]:
        """Names of those that do not."""
        return tuple(name for name, counted in zip(self.names, self.counts.tolist(), strict=True) if not counted)

    def of(self, model: str) -> np.ndarray | None:
        """Squared errors of one of the models on the segments that count [m^2]; None where it was not judged."""
        known = self.squared.get(model)
        return None if known is None or not len(known) else known[self.counts]

    def rmse(self, model: str) -> float | None:
        """Of one of the models [m]; None where it was not judged."""
        known = self.of(model)
        return None if known is None else float(np.sqrt(np.mean(known)))

    def gap(self, model: str) -> float | None:
        """Its floor-corrected gap [m]."""
        known = self.of(model)
        return None if known is None else corrected_gap(float(np.mean(known)), self.floor)


def _means(before: np.ndarray, after: np.ndarray, kept: float) -> tuple[np.ndarray, np.ndarray]:
    """Means over the segments that count, (...,) each, of squared errors (..., segment)."""
    count = counting(np.maximum(before, after), kept)
    much = np.maximum(count.sum(axis=-1), 1)
    first, second = (np.where(count, one, 0.0).sum(axis=-1) / much for one in (before, after))
    return first, second


def share_with_interval(
    before: np.ndarray, after: np.ndarray, floor: float, *, kept: float = 1.0, groups: Sequence[str] = (), seed: int = 0
) -> tuple[float | None, tuple[float, float] | None]:
    """Own share of squared errors (segment,) and its 90 % interval by bootstrap over segments, in two levels where
    `groups` (runs) are several: runs first, then segments within them. kept: share of the segments that count."""
    known = np.isfinite(before) & np.isfinite(after)
    before, after = before[known], after[known]
    count = counting(np.maximum(before, after), kept) if len(before) else known
    value = own_share(before[count], after[count], floor) if len(before) else None
    if value is None or len(before) < 2:
        return value, None
    rng = np.random.default_rng(seed)
    names = [g for g, keep in zip(groups, known, strict=True) if keep] if len(groups) else []
    runs = [np.flatnonzero([name == g for g in names]) for name in dict.fromkeys(names)]
    drawn = []
    for _ in range(DRAWS // 4):
        rows = _rows(rng, runs, len(before))
        G, H = (corrected_gap(float(mean), floor) for mean in _means(before[rows], after[rows], kept))
        if G > 0:
            drawn.append((G - H) / G)
    if len(drawn) < DRAWS // 8:
        return value, None
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return value, (float(low), float(high))


def foretold(
    before: np.ndarray, after: np.ndarray, apart: np.ndarray, floor: float, *, groups: Sequence[str],
    likely: float = 1.0, kept: float = 1.0, seed: int = 0,
) -> tuple[float | None, tuple[float, float] | None]:  # fmt: skip
    """Own share that further segments will have: median and 90 % interval over draws.

    before, after: errors (segment, cap, 3) [m] of refit and effect at other segments, which were left out; apart
    (begin, further, cap, 3) [m]: by how much refit and effect will differ at the further ones (`ahead`). Where the
    effect is right, which is as probable as `likely`, it errs there as elsewhere, and the refit model by `apart` more.
    Where it is wrong nothing is known of what is, and both err as they did elsewhere. Runs (`groups`) are drawn first.
    kept: share of the segments that count, in every draw: a fall makes a share of few segments whatever it likes, so
    the ratio of all that were seen is no forecast. None where most draws are at the floor."""
    known = np.isfinite(before).all(axis=(1, 2)) & np.isfinite(after).all(axis=(1, 2))
    count = apart.shape[1]
    if not known.any() or count < 1:
        return None, None
    names = [g for g, keep in zip(groups, known, strict=True) if keep]
    order = np.argsort([names.index(name) for name in names], kind="stable")
    before, after = before[known][order], after[known][order]
    _, first, own, size = np.unique(
        [names.index(names[i]) for i in order], return_index=True, return_inverse=True, return_counts=True
    )
    rng = np.random.default_rng(seed)
    # Runs in an order of their own in every draw, each with as many places as it has segments, until all are taken.
    turn = rng.permuted(np.tile(np.arange(len(size)), (DRAWS // 4, 1)), axis=1)
    run = own[np.argsort(turn[:, own], axis=1, kind="stable")][:, np.arange(count) % len(own)]
    rows = first[run] + (rng.random(run.shape) * size[run]).astype(int)
    right = rng.random(len(rows)) < likely
    begin = rng.integers(0, len(apart), len(rows))
    with_effect = after[rows]
    refit = np.where(right[:, None, None, None], with_effect + apart[begin], before[rows])
    means = _means(squared_of(refit), squared_of(with_effect), kept)
    G, H = (np.sqrt(np.maximum(mean - floor**2, 0.0)) for mean in means)
    above = (floor / 2 <= G) & (G > 0)
    if above.mean() < 0.5:
        return None, None
    low, middle, high = np.quantile(1.0 - H[above] / G[above], [(1 - LEVEL) / 2, 0.5, (1 + LEVEL) / 2])
    return float(middle), (float(low), float(high))


def squared_of(errors: np.ndarray) -> np.ndarray:
    """Mean squared distance of the caps (...,) [m^2] of errors (..., cap, 3) [m]."""
    return np.asarray(np.sum(errors**2, axis=-1).mean(axis=-1))


def _rows(rng: np.random.Generator, runs: Sequence[np.ndarray], count: int) -> np.ndarray:
    if len(runs) < 2:
        return rng.integers(0, count, count)
    picked = [runs[i] for i in rng.integers(0, len(runs), len(runs))]
    return np.concatenate([rng.choice(one, len(one)) for one in picked])

"""Which blob is which cap: all labellings against the nine cable lengths, or against the shape at rest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schemas.robot import Robot

SENSOR_SD = 0.008
"""[m] Of one sensor length against the distance seen: offset of the day, noise, lag."""
REST_SD = 0.015
"""[m] Of a distance against that of the shape at rest."""
ROD_SD = 0.008
"""[m] Of the distance between two blobs against the rod length."""
SURE = 4.0
"""Least difference of half the squared deviations (log likelihood) to the next labelling: 55 to 1."""
MISSING_COST = 12.0
"""Price of leaving out a cap, in half squared deviations: nearly 5 standard deviations of one of them."""
FREEDOM = 4.0
"""Of Student's t of the distance from where a cap was expected: it may be far off after it was lost."""
ELSEWHERE = 30.0
"""Price of caps that are nowhere near where they were expected, for all of them together, in half squared deviations:
either the prediction holds, or it tells nothing, and then rods and cables alone say which blob is which."""
HERE_M = 0.02
"""[m] A blob no farther from where a cap in sight is expected is a cap of that rod."""
MOST = 20_000
"""Labellings that are tried at most: of robots with many rods, only the likeliest pairs of each rod."""
FIT = 5.0
"""Most that half the squared deviations may be per constraint; beyond, the blobs are not the robot."""


@dataclass(frozen=True)
class Labelling:
    """The best labelling of one frame."""

    p_WE: np.ndarray
    """[m], shape (cap, 3)."""
    pick: np.ndarray
    """Candidate of each cap among those of its rod, shape (cap,)."""
    cost: float
    """Half the sum of squared deviations over standard deviations."""
    margin: float
    """Cost of the next best labelling minus this one; inf where there is no other."""
    sure: bool
    """The margin is at least SURE and the cost fits."""


def label(
    candidates: Sequence[np.ndarray],
    robot: Robot,
    length: np.ndarray | None = None,
    *,
    predicted: tuple[np.ndarray, np.ndarray] | None = None,
    partly: bool = False,
    kept: np.ndarray | None = None,
) -> Labelling | None:
    """Tell the caps apart.

    candidates: of each rod, centres of the blobs of its colour [m], shape (blob, 3), in any frame whose z points up;
    two or more (distractors). length: of the cables by their sensors [m], shape (cable,), NaN where there is none;
    None or all NaN: the shape at rest of robot.toml is compared instead, mirror images told apart, which holds only
    while the robot rests. predicted: caps (cap, 3) and covariance (cap, 3, 3) where the filter expects them; it takes
    the place of the shape at rest. partly: a cap may be missing (NaN, pick -1), at a price. kept: whether
    a cap was in sight just before, (cap,): a blob that lies where it is predicted is not left out if it fits its rod.
    None where some rod has no two blobs a rod length apart (partly: where no blob is left).
    """
    blobs = [np.asarray(one, dtype=float).reshape(-1, 3) for one in candidates]
    pairs = [_pairs(one, rod.length_m, partly) for one, rod in zip(blobs, robot.rods, strict=True)]
    if kept is not None and predicted is not None:
        near = zip(pairs, blobs, predicted[0].reshape(-1, 2, 3), kept.reshape(-1, 2), strict=True)
        pairs = [_with_those_here(of_rod, one, at[here]) for of_rod, one, at, here in near]
    if not all(pairs):
        return None
    most = max(int(MOST ** (1 / len(pairs))), 2)
    pairs = [
        _likeliest(of_rod, one, rod.length_m, most) for of_rod, one, rod in zip(pairs, blobs, robot.rods, strict=True)
    ]
    picks = np.array([np.concatenate(choice) for choice in itertools.product(*pairs)])
    # The last row stands for a cap that is missing: pick -1.
    sets = [np.vstack([blobs[cap // 2], np.full((1, 3), np.nan)])[picks[:, cap]] for cap in range(robot.n_caps)]
    p_WE = np.stack(sets, axis=1)
    rods = np.linalg.norm(p_WE[:, 1::2] - p_WE[:, 0::2], axis=-1) - [rod.length_m for rod in robot.rods]
    missing = np.sum(picks < 0, axis=1)
    if np.all(missing == robot.n_caps):
        return None
    cost = 0.5 * np.nansum((rods / ROD_SD) ** 2, axis=1) + MISSING_COST * missing
    count = len(robot.rods)
    known = np.zeros(0, dtype=int) if length is None else np.flatnonzero(np.isfinite(length))
    if len(known):
        ends = np.array([cable.caps for cable in robot.cables])[known]
        seen = np.linalg.norm(p_WE[:, ends[:, 1]] - p_WE[:, ends[:, 0]], axis=-1)
        cost += 0.5 * np.nansum(((seen - np.asarray(length)[known]) / SENSOR_SD) ** 2, axis=1)
        count += len(known)
    if predicted is not None:
        off = p_WE - predicted[0]
        square = np.einsum("kci,cij,kcj->kc", off, np.linalg.inv(predicted[1] + SENSOR_SD**2 * np.eye(3)), off)
        fit = cost.copy()
        there = 0.5 * (FREEDOM + 3) * np.nansum(np.log1p(square / FREEDOM), axis=1)
        cost = cost - np.logaddexp(-there, -ELSEWHERE)
    elif not len(known):
        cost += 0.5 * _from_rest(p_WE, np.array(robot.rest_caps_m))
        count += 2 * robot.n_caps
    fit = cost if predicted is None else fit
    order = np.argsort(cost)
    best = int(order[0])
    margin = float(cost[order[1]] - cost[best]) if len(order) > 1 else float("inf")
    return Labelling(
        p_WE=p_WE[best], pick=picks[best], cost=float(cost[best]), margin=margin,
        sure=bool(margin >= SURE and fit[best] <= FIT * count),
    )  # fmt: skip


def _pairs(blobs: np.ndarray, length: float, partly: bool) -> list[tuple[int, int]]:
    """Ordered pairs of blobs about a rod length apart; partly: also single blobs, and none (-1)."""
    alone = [pair for i in range(len(blobs)) for pair in ((i, -1), (-1, i))] + [(-1, -1)] if partly else []
    if len(blobs) < 2:
        return alone
    apart = np.linalg.norm(blobs[:, None] - blobs[None], axis=-1)
    return [(int(i), int(j)) for i, j in np.argwhere(np.abs(apart - length) < 5 * ROD_SD)] + alone


def _likeliest(pairs: list[tuple[int, int]], blobs: np.ndarray, length: float, most: int) -> list[tuple[int, int]]:
    """So many pairs that fit the rod best by themselves."""

    def cost(pair: tuple[int, int]) -> float:
        a, b = pair
        if a < 0 or b < 0:
            return MISSING_COST * sum(i < 0 for i in pair)
        return 0.5 * float((np.linalg.norm(blobs[b] - blobs[a]) - length) / ROD_SD) ** 2

    return sorted(pairs, key=cost)[:most]


def _with_those_here(pairs: list[tuple[int, int]], blobs: np.ndarray, at: np.ndarray) -> list[tuple[int, int]]:
    """The pairs that hold every blob at one of those places (place, 3); all of them where none does."""
    far = np.linalg.norm(at[:, None] - blobs[None], axis=-1)
    here = {int(np.argmin(of_place)) for of_place in far if len(of_place) and np.min(of_place) < HERE_M}
    return [pair for pair in pairs if here <= set(pair)] or pairs


def _from_rest(p_WE: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Squared distance over REST_SD to the shape at rest, turned about the vertical and moved; shape (labelling,).

    Rotations about the vertical only: the robot stands on the same caps at rest, so that symmetries of the prism that
    turn it over do not count as the same pose.
    """
    a = p_WE - p_WE.mean(axis=1, keepdims=True)
    b = rest - rest.mean(axis=0)
    across = np.einsum("kci,ci->k", a[:, :, :2], b[:, :2])
    turned = np.einsum("kc,c->k", a[:, :, 1], b[:, 0]) - np.einsum("kc,c->k", a[:, :, 0], b[:, 1])
    flat = np.sum(a[:, :, :2] ** 2, axis=(1, 2)) + np.sum(b[:, :2] ** 2) - 2 * np.hypot(across, turned)
    high = np.sum((a[:, :, 2] - b[:, 2]) ** 2, axis=1)
    return np.asarray((flat + high) / REST_SD**2)

"""Sequences of primitives on paper: where they lead when each does what it did in the simulator.

The robot on the ground is (x, y, yaw, element): the reference moved to (x, y), turned by yaw, and relabelled by a
symmetry. A primitive, relabelled for the triangle that the robot stands on, moves it as it moved the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.plan.placement import Reference, turned, wrapped
from r2s2r_cli.stages.plan.robust import Primitive


@dataclass(frozen=True)
class Moves:
    """Primitives as moves of the reference. shift: (P, 2) [m]; yaw: (P,) [rad]; element: (P,); duration: (P,) [s].
    risk: share of the draws in which it did not work or ended on another triangle, (P,).
    after: (element, element), the symmetry of a robot of the first after a move of the second; axis: direction of the
    principal axis of each symmetry against yaw, (element,) [rad]."""

    shift: np.ndarray
    yaw: np.ndarray
    element: np.ndarray
    duration: np.ndarray
    risk: np.ndarray
    after: np.ndarray
    axis: np.ndarray

    def __len__(self) -> int:
        return len(self.yaw)

    def take(self, rows: np.ndarray) -> Moves:
        """Some of the moves."""
        shared = (self.after, self.axis)
        return Moves(
            self.shift[rows], self.yaw[rows], self.element[rows], self.duration[rows], self.risk[rows], *shared
        )


@dataclass(frozen=True)
class Paths:
    """Sequences of moves, one a row. picks: (B, n); xy: (B, n + 1, 2) [m]; heading: of the principal axis, whole turns
    counted, (B, n + 1) [rad]; yaw, element: of the last pose, (B,)."""

    picks: np.ndarray
    xy: np.ndarray
    heading: np.ndarray
    yaw: np.ndarray
    element: np.ndarray

    def take(self, rows: np.ndarray) -> Paths:
        """The same for some rows."""
        return Paths(self.picks[rows], self.xy[rows], self.heading[rows], self.yaw[rows], self.element[rows])


def moves_of(reference: Reference, primitives: Sequence[Primitive]) -> Moves:
    """The mean moves of primitives."""
    group, axis = reference.group, reference.axis_angles()
    element = np.array([one.element for one in primitives], dtype=int)
    move = np.array([one.move for one in primitives]).reshape(-1, 3)
    after = np.array([[group.product(b, a) for b in range(len(group))] for a in range(len(group))])
    return Moves(
        move[:, :2], wrapped(move[:, 2] - axis[element] + axis[0]), element,
        np.array([one.duration for one in primitives]),
        np.array([1.0 - one.worked * one.same_element for one in primitives]), after, axis,
    )  # fmt: skip


def start_paths() -> Paths:
    """The empty sequence, from the reference."""
    return Paths(
        np.zeros((1, 0), dtype=int), np.zeros((1, 1, 2)), np.zeros((1, 1)), np.zeros(1), np.zeros(1, dtype=int)
    )


def extended(moves: Moves, paths: Paths) -> Paths:
    """Every path followed by every move, (B * P)."""
    b, p = len(paths.yaw), len(moves)
    row, pick = np.repeat(np.arange(b), p), np.tile(np.arange(p), b)
    before = paths.take(row)
    xy = before.xy[:, -1] + turned(moves.shift[pick], before.yaw)
    element = moves.after[before.element, moves.element[pick]]
    turn = wrapped(moves.yaw[pick] + moves.axis[element] - moves.axis[before.element])
    return Paths(
        np.concatenate([before.picks, pick[:, None]], axis=1), np.concatenate([before.xy, xy[:, None]], axis=1),
        np.concatenate([before.heading, before.heading[:, -1:] + turn[:, None]], axis=1),
        before.yaw + moves.yaw[pick], element,
    )  # fmt: skip


RISK = 2.0
"""[m] or [rad] that a sequence may be shorter for not going wrong once."""


def best_sequences(
    moves: Moves, length: int, value: Callable[[Paths], np.ndarray], *, beam: int = 400, reach: float = math.inf,
    sign: float = 0.0,
) -> Paths:  # fmt: skip
    """The sequence of `length` moves with the highest value, less RISK times what may go wrong on the way, by beam
    search on their beginnings. reach: how far it may come from its start [m]; then a shorter one may be the best.
    sign: of the turn that it must make, 0 for any; the empty sequence where none does."""
    paths = start_paths()
    found, highest = paths, -math.inf
    for k in range(length):
        paths = extended(moves, paths)
        paths = paths.take(np.flatnonzero(farthest(paths) <= reach))
        if not len(paths.yaw):
            break
        worth = value(paths) - RISK * moves.risk[paths.picks].sum(axis=1)
        order = np.argsort(-worth, kind="stable")[:beam]
        paths = paths.take(order)
        # On its beginnings a sequence may turn as it likes.
        fit = np.flatnonzero(sign * paths.heading[:, -1] > 0) if sign else np.arange(1)
        # Without a limit all have the length that was asked for.
        if len(fit) and (worth[order[fit[0]]] > highest if math.isfinite(reach) else k == length - 1):
            found, highest = paths.take(fit[:1]), float(worth[order[fit[0]]])
    return found


def farthest(paths: Paths) -> np.ndarray:
    """How far each comes from its start [m], (B,)."""
    return np.asarray(np.linalg.norm(paths.xy - paths.xy[:, :1], axis=-1).max(axis=1))


def different_sequences(moves: Moves, best: Callable[[Moves], Paths | None], most: int) -> list[Paths]:
    """Up to `most` sequences: the best one, then each time the best without the gait that those before used most."""
    found: list[Paths] = []
    allowed = np.arange(len(moves))
    for _ in range(most):
        path = best(moves.take(allowed)) if len(allowed) else None
        if path is None or not path.picks.shape[1]:
            break
        picks = allowed[path.picks]
        found.append(replace(path, picks=picks))
        allowed = allowed[allowed != np.bincount(picks[0]).argmax()]
    return found


def walked(way: Sequence[np.ndarray]) -> Paths:
    """What robots did, as paths: x, y [m] and heading [rad] (B, 3) at the start and after each gait."""
    pose = np.stack(way, axis=1)
    heading = np.unwrap(pose[..., 2], axis=1)
    none = np.zeros(len(pose), dtype=int)
    start = heading[:, :1]
    flat = turned(pose[..., :2] - pose[:, :1, :2], -start)
    return Paths(np.zeros((len(pose), len(way) - 1), dtype=int), flat, heading - start, heading[:, -1], none)


def straight(paths: Paths) -> np.ndarray:
    """Way from start to end, less what the path strays from the line between them, and the turn of the robot."""
    way = paths.xy[:, -1] - paths.xy[:, 0]
    length = np.linalg.norm(way, axis=-1)
    line = way / np.maximum(length, 1e-9)[:, None]
    arm = paths.xy - paths.xy[:, :1]
    stray = np.abs(arm[..., 0] * line[:, None, 1] - arm[..., 1] * line[:, None, 0])
    return np.asarray(length - 2.0 * stray.max(axis=1) - 0.3 * np.abs(paths.heading[:, -1]))


ARC = math.radians(12.0)
"""Turn of the direction of travel at every gait of the arching policy: a circle in thirty gaits."""


def arching(paths: Paths) -> np.ndarray:
    """Length of the path, less what its direction departs from turning by ARC at every gait, always to one side."""
    step = np.diff(paths.xy, axis=1)
    length = np.linalg.norm(step, axis=-1)
    value = length.sum(axis=1) - np.where(length < 0.08, 0.5, 0.0).sum(axis=1)
    if step.shape[1] > 1:
        bend = wrapped(np.diff(np.arctan2(step[..., 1], step[..., 0]), axis=1))
        wrong = np.minimum(np.abs(bend - ARC).sum(axis=1), np.abs(bend + ARC).sum(axis=1))
        value = value - 2.0 * wrong
    return np.asarray(value)


def in_place(sign: float) -> Callable[[Paths], np.ndarray]:
    """Turn of the principal axis, + counter-clockwise, less the way that the robot comes from its place."""

    def value(paths: Paths) -> np.ndarray:
        away = np.linalg.norm(paths.xy - paths.xy[:, :1], axis=-1)
        return np.asarray(sign * paths.heading[:, -1] - 2.0 * away.max(axis=1))

    return value


LONG: dict[str, Callable[[Paths], np.ndarray]] = {
    "straight": straight,
    "arching": arching,
    "turn-clockwise": in_place(-1.0),
    "turn-counterclockwise": in_place(1.0),
}
"""The four long gaits of the paper and what each is to be good at."""
SIGNS = {"turn-clockwise": -1.0, "turn-counterclockwise": 1.0}
"""Which way those turn that are named for it. Their value alone does not tell: a robot that hardly leaves its place is
worth more than one that turns and leaves it, also where it turns the other way."""


def without_rare(primitives: Sequence[Primitive], least: float = 0.95) -> list[Primitive]:
    """Primitives fit for sequences: they come back to rest, where they mostly do, nearly always; each gait once.

    Of a behaviour of which none is, all: a sequence pays for what may go wrong, but a robot that never turns is worse.
    """
    steady = [one.worked * one.same_element >= least for one in primitives]
    served = {one.behaviour for one, good in zip(primitives, steady, strict=True) if good}
    fit = [one for one, good in zip(primitives, steady, strict=True) if good or one.behaviour not in served]
    once: dict[tuple[str, ...], Primitive] = {}
    for one in fit:
        once.setdefault(one.gait.key, one)
    return list(once.values())

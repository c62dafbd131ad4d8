"""The way to a place: A* over sequences of primitives on paper."""

from __future__ import annotations

import heapq
import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.plan.placement import wrapped
from r2s2r_cli.stages.plan.route import Moves, Paths, extended, start_paths

SLOWER = 20.0
"""Times its duration that a detour may take for it, on the way to a goal."""
CELL_M, CELL_RAD = 0.04, math.radians(10.0)
"""States nearer than this count as one in the search for a way."""
GREED = 1.5
"""The estimate of what is left counts so much more: less search, a way at most so much longer."""
NODES = 12_000
"""Poses that are looked at."""
NEARLY = 4.0
"""A way that misses the goal by so much (`Goal.miss`; 2 is the corner of what is near enough) is better than none."""
ON_PAPER = 0.5
"""Share of what is near enough that is asked of a way on paper: the robot ends elsewhere than on paper."""


@dataclass(frozen=True)
class Goal:
    """Where to go, in the frame of the start: x along the principal axis, y forward [m], heading: turn of the principal
    axis [rad]. within_m, within_rad: near enough. typed: as it was asked for."""

    xy: tuple[float, float]
    heading: float
    within_m: float = 0.1
    within_rad: float = math.radians(20.0)
    typed: str = ""

    def miss(self, paths: Paths) -> np.ndarray:
        """How far paths end from it, 1 each at the edge of what is near enough in place and in heading, (B,)."""
        far, turn = self.left(paths.xy[:, -1], paths.heading[:, -1])
        return np.asarray(far / self.within_m + turn / self.within_rad)

    def left(self, xy: np.ndarray, heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far it is from places (..., 2) [m], and how much is left to turn from headings (...) [rad]."""
        far = np.linalg.norm(xy - np.array(self.xy), axis=-1)
        return far, np.abs(wrapped(heading - self.heading))

    def reached(self, xy: np.ndarray, heading: np.ndarray) -> np.ndarray:
        """Which of these places and headings are near enough, (...)."""
        far, turn = self.left(xy, heading)
        return np.asarray((far <= self.within_m) & (turn <= self.within_rad))


def way_near(moves: Moves, goal: Goal) -> Paths:
    """`way_to` a goal that is nearer on paper by ON_PAPER than what is near enough; where no way leads so near, the
    better of that and of the way to what is near enough. Raises as `way_to`."""
    path = None
    with suppress(NumericalError):
        path = way_to(moves, replace(goal, within_m=ON_PAPER * goal.within_m, within_rad=ON_PAPER * goal.within_rad))
        if goal.reached(path.xy[0, -1], path.heading[0, -1]):
            return path
    other = way_to(moves, goal)
    return other if path is None else min(path, other, key=lambda one: float(goal.miss(one)[0]))


def way_to(moves: Moves, goal: Goal) -> Paths:
    """The sequence of moves that takes least time to a goal, by A* (weighted by GREED) on their displacements; moves
    that may go wrong count as slower.

    Where none leads there within NODES poses, the one that comes nearly there; raises NumericalError where none does,
    or none comes nearer than where the robot stands, with the nearest place that one leads to.
    """
    turn_by = np.abs(wrapped(moves.yaw + moves.axis[moves.element] - moves.axis[0]))
    # Of a robot that cannot turn, or cannot travel, no time is foretold for that.
    speed = float((np.linalg.norm(moves.shift, axis=1) / moves.duration).max()) or math.inf
    rate = float((turn_by / moves.duration).max()) or math.inf

    def time_left(paths: Paths) -> np.ndarray:
        far, turn = goal.left(paths.xy[:, -1], paths.heading[:, -1])
        time = np.maximum(np.maximum(far - goal.within_m, 0) / speed, np.maximum(turn - goal.within_rad, 0) / rate)
        return np.asarray(time)

    begun = start_paths()
    count, best, still = 0, (math.inf, begun), float(goal.miss(begun)[0])
    queue: list[tuple[float, int, float, Paths, int]] = [(GREED * float(time_left(begun)[0]), 0, 0.0, begun, 0)]
    done: set[tuple[int, ...]] = set()
    while queue and len(done) < NODES:
        _, _, spent, batch, row = heapq.heappop(queue)
        paths = batch.take(np.array([row]))
        (key,) = _cells(paths)
        if key in done:
            continue
        done.add(key)
        if goal.reached(paths.xy[0, -1], paths.heading[0, -1]):
            return paths
        if paths.picks.shape[1]:
            best = min(best, (float(goal.miss(paths)[0]), paths), key=lambda pair: pair[0])
        after = extended(moves, paths)
        time = time_left(after)
        for k, cell in enumerate(_cells(after)):
            if cell not in done:
                count += 1
                cost = spent + float(moves.duration[k] * (1.0 + SLOWER * moves.risk[k]))
                heapq.heappush(queue, (cost + GREED * float(time[k]), count, cost, after, k))
    near = best[1]
    if best[0] <= NEARLY and best[0] < still:
        return near
    where = "there" if best[0] < still else "nearer to it than the robot stands"
    raise NumericalError(
        f"no sequence of the gaits leads {where}", where=f"--to {goal.typed}".rstrip(),
        expected=f"({goal.xy[0]:g}, {goal.xy[1]:g}) m, "
        f"{math.degrees(goal.heading):g} deg, within {goal.within_m:g} m and {math.degrees(goal.within_rad):.0f} deg",
        received=f"nearest ({near.xy[0, -1, 0]:.2f}, {near.xy[0, -1, 1]:.2f}) m, "
        f"{math.degrees(near.heading[0, -1]):.0f} deg",
        hint=f"--to {near.xy[0, -1, 0]:.2f},{near.xy[0, -1, 1]:.2f},{math.degrees(near.heading[0, -1]):.0f}",
    )  # fmt: skip


def _cells(paths: Paths) -> list[tuple[int, ...]]:
    """The cells of the last poses."""
    place = np.column_stack([paths.xy[:, -1] / CELL_M, wrapped(paths.yaw) / CELL_RAD, paths.element])
    return [tuple(row) for row in np.round(place).astype(int).tolist()]

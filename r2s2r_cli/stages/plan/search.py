"""The search for gaits: from rest to rest through shapes of short and long cables, all children of a level at once.

Paper, section "Developing Policies with Symmetry Reduction": nodes are robot poses with binary cable lengths, edges are
cable controls (retract, extend, hold), depth 4, root and leaves at rest. Three things make it fast:

- Nodes that are the same robot after a symmetry and a motion over the ground have the same future. One of each class is
  simulated, and what becomes of it is told of the others (`alike`).
- A gait through the rest shape is two gaits; it is not looked at again.
- Where a level has more classes than the beam, those go on that came farthest, closed to rest, for any behaviour.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.plan.alike import Alike, alike, carried, told_targets
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import Gait, Seen, neighbours, outcomes, seen
from r2s2r_cli.stages.plan.placement import Reference
from r2s2r_cli.stages.plan.rewards import Outcomes, Reward, joined
from r2s2r_cli.stages.plan.standing import Standing


@dataclass(frozen=True)
class SearchSettings:
    """depth: target shapes of a gait, the return to rest included. beam: classes of poses that go on from a level, 0:
    all. merge_m: poses nearer than this are one class, 0: none are. most_changed: cables that one step may switch.
    rest_error_m: a gait that ends farther from the rest pose is none."""

    depth: int = 4
    beam: int = 250
    merge_m: float = 0.006
    most_changed: int = 6
    rest_error_m: float = 0.03


@dataclass(frozen=True)
class Found:
    """Gaits of the search and what the search says of them; simulated: robots times targets that were simulated;
    pruned: classes of poses that the beam left behind; lost: that gave a target up, or left the finite numbers."""

    gaits: list[Gait]
    outcomes: Outcomes
    simulated: int
    pruned: int
    lost: int


@dataclass(frozen=True)
class _Level:
    """Nodes of one depth. targets: (B, depth, motor); at: the robots; pose: what is seen of them; ticks: until here;
    same: their classes; parent: row of the level before, a leader there, (B,)."""

    targets: np.ndarray
    at: Standing
    pose: Seen
    ticks: np.ndarray
    same: Alike
    parent: np.ndarray


_Closed = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Points, ticks and soundness of nodes that were brought to rest."""


class Search:
    """One search from one rested robot. executor: with one draw, the best values."""

    def __init__(
        self, executor: Executor, reference: Reference, start: Standing, rewards: Mapping[str, Reward],
        settings: SearchSettings, progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> None:  # fmt: skip
        self.executor, self.reference, self.rewards, self.settings = executor, reference, rewards, settings
        self.start, self.begun = start, seen(executor, start)
        self.progress = progress
        self.simulated = self.pruned = self.lost = 0

    def found(self) -> Found:
        """All gaits that come back to rest, each with its outcome: simulated, or told by a pose of its class."""
        levels: list[_Level] = []
        gaits: list[Gait] = []
        parts = [_none()]
        motors = self.executor.structure.n_actuated
        origin = np.ones((1, 0, motors))
        closed: _Closed | None = None
        for depth in range(1, self.settings.depth):
            if closed is None:
                level = self._expanded(self.start, origin, np.zeros(1, dtype=int), np.zeros(1, dtype=int))
            else:
                going = self._promising(levels[-1], closed)
                level = self._expanded(levels[-1].at, levels[-1].targets, going, levels[-1].ticks)
            levels.append(level)
            if not len(level.ticks):
                break  # every target was given up, or there are no other shapes: nothing goes on from here
            closed = self._closed(level)
            made, came = self._unfolded(levels, closed)
            gaits += made
            parts.append(came)
            self.progress(depth, self.settings.depth - 1)
        return Found(gaits, joined(parts), self.simulated, self.pruned, self.lost)

    def _expanded(self, at: Standing, before: np.ndarray, going: np.ndarray, ticks: np.ndarray) -> _Level:
        """The children of nodes `going`, all in one call; those that gave up are left out."""
        children, parent = [], []
        for row in going:
            last = before[row, -1] if before.shape[1] else np.ones(before.shape[2])
            made = neighbours(last, self.settings.most_changed)
            children.append(made)
            parent.append(np.full(len(made), row))
        targets, parents = np.concatenate(children), np.concatenate(parent)
        run = self.executor.run(at.take(parents), targets[:, None])
        good = np.flatnonzero(run.sound)
        self.simulated += len(targets)
        self.lost += len(targets) - len(good)
        path = np.concatenate([before[parents], targets[:, None]], axis=1)[good]
        spent = (ticks[parents] + run.ticks[:, 0])[good]
        # Those that got there with the fewest switched cables, then soonest, lead their classes.
        switched = np.array([Gait(one).switched for one in path])
        order = np.lexsort((spent, switched))
        good, path, spent = good[order], path[order], spent[order]
        ends = run.ends[0].take(good)
        pose = seen(self.executor, ends)
        same = alike(self.reference.group, path[:, -1], pose.caps, self.executor.speeds(ends), self.settings.merge_m)
        return _Level(path, ends, pose, spent, same, parents[good])

    def _closed(self, level: _Level) -> _Closed:
        """Every node brought to rest: points (B, cap + 1, 3), ticks (B,), and whether it got there (B,); leaders are
        simulated, the others told."""
        leaders = level.same.leaders
        rest = np.ones((len(leaders), 1, level.targets.shape[2]))
        run = self.executor.run(level.at.take(leaders), rest)
        self.simulated += len(leaders)
        self.lost += int((~run.sound).sum())
        place = np.searchsorted(leaders, level.same.leader)
        ended = seen(self.executor, run.ends[0]).points
        points = self._told(level, np.arange(len(level.ticks)), ended[place])
        return points, level.ticks + run.ticks[place, 0], run.sound[place]

    def _told(self, level: _Level, member: np.ndarray, points: np.ndarray) -> np.ndarray:
        return carried(self.reference.group, level.same, level.pose.caps, member, points)

    def _unfolded(self, levels: list[_Level], closed: _Closed) -> tuple[list[Gait], Outcomes]:
        """The gaits of the last level: its nodes, and their copies behind every node that is like one of their
        ancestors."""
        node = np.flatnonzero(closed[2])
        points, ticks = closed[0][node], closed[1][node]
        tail, parent = levels[-1].targets[node][:, -1:], levels[-1].parent[node]
        for above in reversed(levels[:-1]):
            children: dict[int, np.ndarray] = {int(k): np.flatnonzero(parent == k) for k in np.unique(parent)}
            member = [m for m in range(len(above.ticks)) if int(above.same.leader[m]) in children]
            if not member:
                return [], _none()
            child = [children[int(above.same.leader[m])] for m in member]
            who = np.repeat(member, [len(c) for c in child])
            which = np.concatenate(child)
            points = self._told(above, who, points[which])
            ticks = ticks[which] + above.ticks[who] - above.ticks[above.same.leader[who]]
            tail = np.stack(
                [told_targets(self.reference.group, above.same, who, tail[which, k]) for k in range(tail.shape[1])],
                axis=1,
            )
            tail = np.concatenate([above.targets[who][:, -1:], tail], axis=1)
            parent = above.parent[who]
        rest = np.ones((len(tail), 1, tail.shape[2]))
        gaits = [Gait(one) for one in np.concatenate([tail, rest], axis=1)]
        came = outcomes(self.reference, self.begun, Seen(points), ticks, self.executor.period,
                        np.array([gait.switched for gait in gaits]))  # fmt: skip
        good = np.flatnonzero(came.error < self.settings.rest_error_m)
        return [gaits[k] for k in good], came.take(good)

    def _promising(self, level: _Level, closed: _Closed) -> np.ndarray:
        """Leaders that go on: for each behaviour in turn the one that came farthest, brought to rest or as it is."""
        leaders, beam = level.same.leaders, self.settings.beam
        if not beam or len(leaders) <= beam:
            return leaders
        switched = np.zeros(len(level.ticks))
        rankings = []
        for points in (closed[0], level.pose.points):
            came = outcomes(self.reference, self.begun, Seen(points), level.ticks, self.executor.period, switched)
            for reward in self.rewards.values():
                best = np.full(len(level.ticks), -np.inf)
                np.maximum.at(best, level.same.leader, reward(came))
                rankings.append(leaders[np.argsort(-best[leaders], kind="stable")])
        taken: dict[int, None] = {}
        for turn in range(len(leaders)):
            for ranking in rankings:
                if len(taken) < beam:
                    taken.setdefault(int(ranking[turn]))
        self.pruned += len(leaders) - len(taken)
        return np.array(sorted(taken))


def best_of(found: Found, reward: Reward, count: int, *, apart_m: float = 0.002, apart_rad: float = 0.01) -> list[int]:
    """Rows of the `count` gaits with the highest reward, of those with one outcome only the one that switches fewest
    cables. apart: outcomes nearer than this on the same triangle are one. Of no gaits no reward is asked."""
    came = found.outcomes
    if not len(came):
        return []
    value = reward(came)
    place = np.round(np.column_stack([came.com[:, :2] / apart_m, came.turn / apart_rad])).astype(int)
    seen_keys: dict[tuple[int, ...], int] = {}
    for row in np.lexsort((came.duration, came.switched)):
        seen_keys.setdefault((int(came.element[row]), *place[row].tolist()), int(row))
    rows = np.array(sorted(seen_keys.values()))
    return [int(row) for row in rows[np.argsort(-value[rows], kind="stable")][:count]]


def _none() -> Outcomes:
    empty = np.zeros(0)
    return Outcomes(np.zeros((0, 3)), empty, np.zeros(0, dtype=int), empty, empty, empty)

"""Long policies: gaits one after the other, relabelled for the triangle that the robot has come to, and smoothed.

Every gait is simulated from where the one before left the robot; the pose says which symmetry relabels the next.
Smoothing is the paper's (appendix "Gaits Transition Smoothing"): the return to rest between two gaits is dropped, and
the robot goes on from its last shape to the shape of the next gait that switches fewest cables. A shortcut may tip the
robot another way, so each is simulated first, from all drawn numbers, and taken where it leads to the same end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import Seen, padded, seen
from r2s2r_cli.stages.plan.placement import Reference, wrapped
from r2s2r_cli.stages.plan.robust import Primitive
from r2s2r_cli.stages.plan.standing import Standing, stacked
from r2s2r_cli.stages.plan.symmetry import principal_axis

NEAR_M, SHARE = 0.02, 0.25
"""A shortcut may end so far from where the whole gait ends, and a share of the way of that gait farther."""
NEAR_RAD, RAD_PER_M = np.radians(3.0), 1.0
"""Likewise for its turn: a gait that travels may turn otherwise by so much a metre, one that turns by SHARE of that."""
AGREED = 0.9
"""Share of the drawn numbers that must come to the same end after a shortcut."""


@dataclass
class Walk:
    """One long policy while it is made, for a number of robots with drawn numbers; the first has the best ones.

    gaits: names so far; targets: shapes so far, without the last return to rest. bent: the robots before that return,
    last_shape what they have then; rested: after it, com [m] (B, 3) and heading of the principal axis [rad] (B,) there.
    elements: symmetry of the first robot before each gait. saved: targets that smoothing left out; shortcuts: taken.
    lost: robots that gave a target up. way: x, y [m] and heading [rad] of every robot at the start and after each gait.
    """

    bent: Standing
    rested: Standing
    com: np.ndarray
    heading: np.ndarray
    last_shape: np.ndarray
    lost: np.ndarray
    gaits: list[str] = field(default_factory=list)
    targets: list[np.ndarray] = field(default_factory=list)
    elements: list[int] = field(default_factory=list)
    saved: int = 0
    shortcuts: int = 0
    way: list[np.ndarray] = field(default_factory=list)

    @property
    def policy(self) -> np.ndarray:
        """All targets (S, motor), the return to rest at the end included."""
        return np.array([*self.targets, np.ones_like(self.last_shape)])


@dataclass(frozen=True)
class _Option:
    """One way into the next gait. skipped: its targets that are left out; whole: from rest, nothing is."""

    whole: bool
    skipped: int
    targets: np.ndarray
    switched: int


def walks(
    executor: Executor, reference: Reference, start: Standing, sequences: Sequence[Sequence[Primitive]], *,
    smooth: bool = True, progress: Callable[[int], None] = lambda done: None,
) -> list[Walk]:  # fmt: skip
    """Long policies of the sequences of gaits, gait by gait, those of all sequences in one call of the engine."""
    motors = executor.structure.n_actuated
    pose = seen(executor, start)
    turned_to, none = _heading(pose.caps), np.zeros(len(start), dtype=bool)
    made = [Walk(start, start, pose.com, turned_to, np.ones(motors), none) for _ in sequences]
    for walk in made:
        walk.way.append(np.column_stack([pose.com[:, :2], turned_to]))
    for k in range(max(map(len, sequences))):
        going = [(walk, seq[k]) for walk, seq in zip(made, sequences, strict=True) if k < len(seq)]
        _stepped(executor, reference, [walk for walk, _ in going], [one for _, one in going], smooth)
        progress(k + 1)
    return made


def _stepped(executor: Executor, reference: Reference, going: list[Walk], gaits: list[Primitive], smooth: bool) -> None:
    """The next gait of every walk."""
    options: list[list[_Option]] = []
    begun: list[Standing] = []
    goals: list[np.ndarray] = []
    for walk, gait in zip(going, gaits, strict=True):
        element = int(reference.place(executor.caps(walk.rested.take(np.zeros(1, dtype=int)))).element[0])
        walk.elements.append(element)
        targets = reference.group.elements[element].relabelled(gait.gait.targets)
        ways = _options(walk, targets, smooth)
        options.append(ways)
        for way in ways:
            begun.append(walk.rested if way.whole else walk.bent)
            goals += [way.targets] * len(walk.rested)
    at = stacked(begun)
    run = executor.run(at, *padded(goals))
    ended, bent = run.last, run.before_last(1)
    pose = seen(executor, ended)
    row = 0
    for walk, gait, ways in zip(going, gaits, options, strict=True):
        size = len(walk.rested)
        blocks = [np.arange(row + k * size, row + (k + 1) * size) for k in range(len(ways))]
        row += size * len(ways)
        taken = _taken(reference, walk, ways, [Seen(pose.points[b]) for b in blocks],
                       [run.sound[b] for b in blocks])  # fmt: skip
        way, block = ways[taken], blocks[taken]
        if way.whole and walk.targets:
            walk.targets.append(np.ones_like(walk.last_shape))
        if not way.whole:
            walk.shortcuts += 1
            walk.saved += 1 + way.skipped
        walk.targets += list(way.targets[:-1])
        walk.gaits.append(gait.name)
        walk.last_shape = way.targets[-2] if len(way.targets) > 1 else walk.last_shape
        walk.bent, walk.rested, walk.com = bent.take(block), ended.take(block), pose.com[block]
        walk.heading = _heading(pose.caps[block])
        walk.way.append(np.column_stack([walk.com[:, :2], walk.heading]))
        walk.lost = walk.lost | ~run.sound[block]


def _options(walk: Walk, targets: np.ndarray, smooth: bool) -> list[_Option]:
    """The whole gait from rest, then shortcuts by the number of cables that they switch, fewest first; of equal ones
    the one that leaves out more."""
    whole = _Option(True, 0, targets, 0)
    if not smooth or not walk.targets:
        return [whole]
    ways = []
    for j in range(len(targets) - 1):
        switched = int(np.abs(targets[j] - walk.last_shape).sum())
        # A shape that the robot has already is no target.
        first = j + 1 if switched == 0 and j + 2 < len(targets) else j
        ways.append(_Option(False, first, targets[first:], switched))
    return [whole, *sorted(ways, key=lambda way: (way.switched, -way.skipped))]


def _taken(reference: Reference, walk: Walk, ways: list[_Option], ends: list[Seen], sound: list[np.ndarray]) -> int:
    """The first shortcut that leads where the whole gait leads; 0: none does."""
    whole = ends[0]
    goal = reference.place(whole.caps)
    moved = np.linalg.norm((whole.com - walk.com)[:, :2], axis=1)
    turn = np.abs(wrapped(_heading(whole.caps) - walk.heading))
    for k in range(1, len(ways)):
        here = reference.place(ends[k].caps)
        off = np.linalg.norm((ends[k].com - whole.com)[:, :2], axis=1)
        turned_by = np.abs(wrapped(here.yaw - goal.yaw))
        near = (off < NEAR_M + SHARE * moved) & (turned_by < NEAR_RAD + SHARE * turn + RAD_PER_M * moved)
        same = (here.element == goal.element) & near & sound[k]
        good = sound[0] & ~walk.lost
        if same[0] and (same[good].mean() if good.any() else 0.0) >= AGREED:
            return k
    return 0


def _heading(p_WE: np.ndarray) -> np.ndarray:
    """Direction of the principal axis over the ground [rad] of poses (B, cap, 3)."""
    axis = principal_axis(p_WE)
    return np.asarray(np.arctan2(axis[:, 1], axis[:, 0]))

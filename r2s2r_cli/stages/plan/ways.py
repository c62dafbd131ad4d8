"""Long policies: which sequences of gaits are tried for each, and which of them is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.plan.goal import Goal, way_near
from r2s2r_cli.stages.plan.long import Walk, walks
from r2s2r_cli.stages.plan.robust import Primitive, usual_ends
from r2s2r_cli.stages.plan.route import (
    LONG,
    SIGNS,
    Moves,
    Paths,
    best_sequences,
    different_sequences,
    farthest,
    moves_of,
    walked,
    without_rare,
)
from r2s2r_cli.stages.plan.standing import Standing
from r2s2r_cli.stages.plan.world import Progress, Request, World
from schemas.config import PlanSettings

SEQUENCES = 4
"""Sequences of gaits that are tried for each long policy."""
ASTRAY = 2.0
"""[m] or [rad] that a sequence may be worth less for ending where it should from all drawn numbers and starts: the loss
where none of them ends where most do."""
LOST = -10.0
"""Worth of a sequence in which the robot gives a target up or leaves its area, where no other is worth less."""
MARGIN = 0.9
"""Share of its area that a sequence may use on paper: on its way between the ends of its gaits it comes farther."""


@dataclass(frozen=True)
class Way:
    """A long policy before it is judged. path: on paper."""

    name: str
    path: Paths
    walk: Walk


def ways(
    world: World, request: Request, settings: PlanSettings, primitives: Sequence[Primitive], progress: Progress
) -> list[Way]:
    """The paper's long gaits and the ways to the goals, made of gaits that can be relied on.

    Of several sequences for each the one is taken that does best in the simulator, over drawn numbers; none where all
    turn the other way than the name says.
    """
    fit = without_rare(primitives)
    moves = moves_of(world.reference, fit)
    values: dict[str, Callable[[Paths], np.ndarray]] = dict(LONG)
    tried: list[tuple[str, Paths]] = []
    for name, value in LONG.items():
        best = partial(
            best_sequences, length=settings.cycles, value=value, reach=MARGIN * request.reach, sign=SIGNS.get(name, 0.0)
        )
        tried += [(name, path) for path in different_sequences(moves, best, SEQUENCES)]
    for name, goal in request.goals.items():
        values[name] = partial(_near, goal)
        found = different_sequences(moves, partial(_way_or_none, goal), SEQUENCES)
        if not found:
            way_near(moves, goal)  # raises where there is none at all
        tried += [(name, path) for path in found]
    longest = max((path.picks.shape[1] for _, path in tried), default=0)

    def walked_along(paths: list[tuple[str, Paths]], start: Standing, *, smooth: bool, part: str) -> list[Walk]:
        if not paths:
            return []
        sequences = [[fit[k] for k in path.picks[0]] for _, path in paths]
        return walks(world.executor, world.reference, start, sequences, smooth=smooth,
                     progress=lambda done: progress(part, done, longest))  # fmt: skip

    def astray(walk: Walk) -> float:
        rested = world.reference.place(world.executor.caps(walk.rested)).error < settings.rest_error_m
        return share_astray(walk, rested)

    judged: dict[str, list[tuple[Paths, Walk, np.ndarray, np.ndarray]]] = {}
    for (name, path), walk in zip(tried, walked_along(tried, world.pairs, smooth=False, part="sequences"), strict=True):
        if turns_as_named(name, walk):
            came = walked(walk.way)
            away = (farthest(came) > request.reach) & (name not in request.goals)
            judged.setdefault(name, []).append((path, walk, values[name](came), walk.lost | away))
    score: dict[str, tuple[float, Paths]] = {}
    whole: dict[str, Walk] = {}
    for name, sequences in judged.items():
        lost = worth_of_lost([(worth, gone) for _, _, worth, gone in sequences])
        for path, walk, worth, gone in sequences:
            worths = np.where(gone, lost, worth)
            one = float(worths.mean() - settings.spread * worths.std()) - ASTRAY * astray(walk)
            if name not in score or one > score[name][0]:
                score[name], whole[name] = (one, path), walk
    chosen_paths = [(name, path) for name, (_, path) in score.items()]
    made = walked_along(chosen_paths, world.few, smooth=settings.smooth, part="long policies")
    # Every shortcut led where the whole gait led, and yet what follows it may not: then the returns to rest stay.
    kept = [
        walk if astray(walk) <= astray(whole[name]) and turns_as_named(name, walk) else whole[name]
        for (name, _), walk in zip(chosen_paths, made, strict=True)
    ]
    return [Way(name, path, walk) for (name, path), walk in zip(chosen_paths, kept, strict=True)]


def worth_of_lost(sequences: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Worth of a robot that gives a target up or leaves its area, given the worths and who did so (B,) of every
    sequence for one purpose: no more than that of any that did not, however far it ends from a narrow goal."""
    return min([LOST, *(float(worth[~gone].min()) for worth, gone in sequences if not gone.all())])


def turns_as_named(name: str, walk: Walk) -> bool:
    """Whether a long policy turns the way its name says, in the mean of the robots that give no target up."""
    going = ~walk.lost if not walk.lost.all() else np.ones_like(walk.lost)
    return name not in SIGNS or float(walked(walk.way).heading[going, -1].mean()) * SIGNS[name] > 0


def share_astray(walk: Walk, rested: np.ndarray) -> float:
    """Share of the robots that gave a target up, are not in the rest pose (rested: which are, (B,)), or ended where
    most of the others did not."""
    came = walked(walk.way)
    moves = np.column_stack([came.xy[:, -1], came.heading[:, -1]])
    good = ~walk.lost & rested
    if not good.any():
        return 1.0
    good[good] = usual_ends(moves[good])
    return float(1.0 - good.mean())


def _near(goal: Goal, paths: Paths) -> np.ndarray:
    return -goal.miss(paths)


def _way_or_none(goal: Goal, moves: Moves) -> Paths | None:
    try:
        return way_near(moves, goal)
    except NumericalError:
        return None

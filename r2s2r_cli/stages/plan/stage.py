"""`plan`: from what is known of a robot to gaits, long policies of them, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.plan.belief import Belief
from r2s2r_cli.stages.plan.choose import ChoiceSettings, Judge, chosen, shortlist
from r2s2r_cli.stages.plan.executor import Executor, Standing
from r2s2r_cli.stages.plan.gaits import Gait
from r2s2r_cli.stages.plan.groups import (
    LongPolicy,
    gait_figures,
    long_group,
    policy_figures,
    primitives_group,
    symmetry_groups,
)
from r2s2r_cli.stages.plan.long import Walk, walks
from r2s2r_cli.stages.plan.placement import Reference, reference_of
from r2s2r_cli.stages.plan.rewards import Reward
from r2s2r_cli.stages.plan.robust import Primitive, start_poses
from r2s2r_cli.stages.plan.route import (
    LONG,
    Goal,
    Moves,
    Paths,
    best_sequences,
    different_sequences,
    moves_of,
    walked,
    way_to,
    without_rare,
)
from r2s2r_cli.stages.plan.runs import played, policy_file, run_groups
from r2s2r_cli.stages.plan.search import Search, SearchSettings
from r2s2r_cli.stages.plan.symmetry import symmetry_group
from r2s2r_cli.stages.simulate.policies import policy_group
from schemas.config import PlanSettings
from schemas.results_plan import PlanReport
from schemas.robot import Robot

SLOW = 1.5
"""Times the time that the slowest winch takes for its whole range, after which the search gives a target up."""
SEQUENCES = 4
"""Sequences of gaits that are tried for each long policy."""
LOST = -10.0
"""Worth of a sequence in which the robot gives a target up: less than any other."""
FEW = 8
"""Pairs of numbers and start poses that long policies are made and judged on."""


class Checkpoint(Protocol):
    """Where finished parts are kept; JSON values only."""

    def load(self) -> dict[str, Any] | None:
        """What was saved last, or None."""
        ...

    def save(self, values: Mapping[str, Any]) -> None:
        """Replace what was saved."""
        ...


@dataclass(frozen=True)
class Request:
    """What is to be planned. rewards: behaviours by name; goals: places to go by the name of their policy."""

    belief: Belief
    rewards: Mapping[str, Reward]
    goals: Mapping[str, Goal] = field(default_factory=dict)
    seed: int = 0


Progress = Callable[[str, int, int], None]
"""Called with the part of the work, and how many of how many of its steps are done."""


def plan(
    robot: Robot, request: Request, settings: PlanSettings, *, cache_dir: Path | None = None, threads: int = 1,
    progress: Progress = lambda part, done, total: None, checkpoint: Checkpoint | None = None,
) -> tuple[ArtifactData, PlanReport]:  # fmt: skip
    """Search gaits, judge them over what is not known, and make long policies of the best. Layout: `schemas/plan.py`.

    threads: of the engine; the result does not depend on it. Raises InputError for a robot that cannot be planned for,
    NumericalError where no gait is found, or none leads to a goal.
    """
    world = _World(robot, request, settings, cache_dir, threads)
    saved = (checkpoint.load() if checkpoint is not None else None) or {}

    def keep(**values: Any) -> None:
        saved.update(values)
        if checkpoint is not None:
            checkpoint.save(saved)

    if "shortlist" not in saved:
        keep(**_searched(world, request, settings, progress))
    listed = {name: [_gait(shapes) for shapes in gaits] for name, gaits in saved["shortlist"].items()}
    if not any(listed.values()):
        raise NumericalError(
            "no gait leads from rest to rest", where="plan", expected="gaits that reach their targets and come back",
            received=f"{saved['lost']} of {saved['simulated']} simulated targets given up",
            hint="r2s2r plan --set plan.rest_error_m=0.05",
        )  # fmt: skip
    if "primitives" not in saved:
        judge = Judge(world.executor, world.reference, world.pairs, settings.rest_error_m)
        choice = ChoiceSettings(
            finalists=max(settings.kept, settings.candidates // 3), kept=settings.kept, spread=settings.spread
        )
        best = chosen(judge, listed, request.rewards, choice, lambda done, total: progress("judge", done, total))
        keep(primitives=[_as_json(one) for gaits in best.values() for one in gaits], pairs=len(judge.pairs))
    primitives = [_from_json(one) for one in saved["primitives"]]
    ways = _ways(world, request, settings, primitives, progress)
    return _concluded(world, request, settings, saved, primitives, ways)


class _World:
    """The engine with its numbers and starts. best: with the best numbers, start: its robot at rest; executor: with all
    draws, pairs: its robots from all start poses, the first as `start`; few: some of these."""

    def __init__(
        self, robot: Robot, request: Request, settings: PlanSettings, cache_dir: Path | None, threads: int
    ) -> None:
        generator = np.random.default_rng(request.seed)
        draws = request.belief.draws(settings.draws, generator)
        self.robot = robot
        group = symmetry_group(robot)
        shared: dict[str, Any] = {
            "step": settings.step_s, "rod_contact": settings.rod_contact, "cache_dir": cache_dir, "threads": threads,
        }  # fmt: skip
        bias = settings.sensor_sd_m * generator.standard_normal((settings.draws, len(robot.cables)))
        bias[0] = 0.0
        self.executor = Executor(robot, request.belief, draws, bias=bias, **shared)
        slowest = float(self.executor.theta.speed_in[0].min())
        limit = SLOW * robot.pid.range_m / slowest + float(self.executor.delay[0])
        self.best = Executor(
            robot, request.belief, draws[:1], timeout_s=min(limit, robot.pid.step_timeout_s), hurried=True, **shared
        )
        self.best.simulator = self.executor.simulator
        self.start: Standing = self.best.standing(np.array(robot.rest_caps_m)[None], np.zeros(1, dtype=int))
        self.reference: Reference = reference_of(self.best.caps(self.start)[0], group)
        self.pairs = start_poses(self.executor, robot, settings.starts, generator)
        self.few = self.pairs.take(np.unique(np.linspace(0, len(self.pairs) - 1, FEW).round().astype(int)))


def _searched(world: _World, request: Request, settings: PlanSettings, progress: Progress) -> dict[str, Any]:
    """The shortlist of every behaviour, and what the search took, as JSON values."""
    search = SearchSettings(settings.depth, settings.beam, settings.merge_m, settings.most_changed,
                            settings.rest_error_m)  # fmt: skip
    found = Search(
        world.best, world.reference, world.start, request.rewards, search,
        lambda done, total: progress("search", done, total),
    ).found()  # fmt: skip
    listed = shortlist(found, request.rewards, settings.candidates)
    return {
        "shortlist": {name: [list(gait.key) for gait in gaits] for name, gaits in listed.items()},
        "simulated": found.simulated, "pruned": found.pruned, "lost": found.lost, "found": len(found.gaits),
    }  # fmt: skip


@dataclass(frozen=True)
class _Way:
    """A long policy before it is judged. path: on paper."""

    name: str
    path: Paths
    walk: Walk


def _ways(
    world: _World, request: Request, settings: PlanSettings, primitives: Sequence[Primitive], progress: Progress
) -> list[_Way]:
    """The paper's long gaits and the ways to the goals, made of gaits that can be relied on.

    Of several sequences for each the one is taken that does best in the simulator, over drawn numbers.
    """
    fit = without_rare(primitives)
    moves = moves_of(world.reference, fit)
    values: dict[str, Callable[[Paths], np.ndarray]] = dict(LONG)
    tried: list[tuple[str, Paths]] = []
    for name, value in LONG.items():
        best = partial(best_sequences, length=settings.cycles, value=value, count=1)
        tried += [(name, path) for path in different_sequences(moves, best, SEQUENCES)]
    for name, goal in request.goals.items():
        way_to(moves, goal)  # raises where there is none at all
        values[name] = partial(_near, goal)
        tried += [(name, path) for path in different_sequences(moves, partial(_way_or_none, goal), SEQUENCES)]
    longest = max((path.picks.shape[1] for _, path in tried), default=0)

    def walked_along(paths: list[tuple[str, Paths]], *, smooth: bool, part: str) -> list[Walk]:
        sequences = [[fit[k] for k in path.picks[0]] for _, path in paths]
        return walks(world.executor, world.reference, world.few, sequences, smooth=smooth,
                     progress=lambda done: progress(part, done, longest))  # fmt: skip

    score: dict[str, tuple[float, Paths]] = {}
    for (name, path), walk in zip(tried, walked_along(tried, smooth=False, part="sequences"), strict=True):
        worth = np.where(walk.lost, LOST, values[name](walked(walk.way)))
        one = float(worth.mean() - settings.spread * worth.std())
        if name not in score or one > score[name][0]:
            score[name] = one, path
    chosen_paths = [(name, path) for name, (_, path) in score.items()]
    made = walked_along(chosen_paths, smooth=settings.smooth, part="long policies")
    return [_Way(name, path, walk) for (name, path), walk in zip(chosen_paths, made, strict=True)]


def _near(goal: Goal, paths: Paths) -> np.ndarray:
    return -goal.miss(paths)


def _way_or_none(goal: Goal, moves: Moves) -> Paths | None:
    try:
        return way_to(moves, goal)
    except NumericalError:
        return None


def _concluded(
    world: _World, request: Request, settings: PlanSettings, saved: Mapping[str, Any],
    primitives: Sequence[Primitive], ways: Sequence[_Way],
) -> tuple[ArtifactData, PlanReport]:  # fmt: skip
    """The artifact and the report."""
    robot, counts = world.robot, {name: int(saved[name]) for name in ("simulated", "pruned", "lost", "found")}
    files = {one.name: policy_file(robot, one.name, _said(one), one.gait.targets) for one in primitives}
    long = {one.name: policy_file(robot, one.name, " ".join(one.walk.gaits), one.walk.policy) for one in ways}
    first = {one.behaviour: files[one.name] for one in reversed(primitives)}
    shown = [first[name] for name in request.rewards if name in first] + list(long.values())
    runs = {run.policy.name: run for run in played(world.executor, world.reference, world.few, shown)}
    policies = [
        LongPolicy(
            one.name, one.walk, one.path, runs[one.name].came,
            runs[one.name].sound & (runs[one.name].came.error < settings.rest_error_m), request.goals.get(one.name),
        )
        for one in ways
    ]  # fmt: skip
    facts: dict[str, Scalar] = {
        "robot": robot.name, "engine": f"r2s2r {__version__}", "numbers": request.belief.words,
        "identified": request.belief.identified, "seed": request.seed, "step": settings.step_s,
        "depth": settings.depth, **counts,
    }  # fmt: skip
    groups = {
        "plan": Group({}, facts), **symmetry_groups(world.reference), "primitives": primitives_group(primitives),
        **({"long": long_group(policies)} if policies else {}),
        **{f"policies/{name}": policy_group(policy) for name, policy in {**files, **long}.items()},
        **run_groups(world.executor, robot, world.few, list(runs.values())),
    }  # fmt: skip
    report = PlanReport(
        numbers=request.belief.words, identified=request.belief.identified,
        symmetries=len(world.reference.group), draws=settings.draws, pairs=int(saved["pairs"]),
        gaits=tuple(map(gait_figures, primitives)), policies=tuple(map(policy_figures, policies)),
        computed_by="torch" if world.best.computed_by_torch else "machine code",
        warnings=tuple(_warnings(world, request, settings, primitives, policies)),
        found=counts["found"], simulated=counts["simulated"], pruned=counts["pruned"], lost=counts["lost"],
    )  # fmt: skip
    return ArtifactData("plan", groups), report


def _said(one: Primitive) -> str:
    x, y, turn = one.move
    return (
        f"{one.behaviour}: {1e3 * x:+.0f}, {1e3 * y:+.0f} mm (x along the axis, y forward), {np.degrees(turn):+.0f} deg"
    )


def _warnings(
    world: _World, request: Request, settings: PlanSettings, primitives: Sequence[Primitive],
    policies: Sequence[LongPolicy],
) -> Sequence[str]:  # fmt: skip
    said = []
    if not request.belief.identified:
        said.append("nothing was identified: the gaits are those of robot.toml's numbers, judged over their priors")
    if len(world.reference.group) == 1:
        said.append("the robot has no symmetry: a gait serves the triangle that it was found on, and no other")
    kept = {name: [one for one in primitives if one.behaviour == name] for name in request.rewards}
    for name, gaits in kept.items():
        if len(gaits) < settings.kept:
            said.append(f"{name}: {len(gaits)} gaits found, {settings.kept} were wanted")
        if gaits and gaits[0].mean <= 0:
            said.append(f"{name}: the best gait earns {gaits[0].mean:.3g}: the robot does not move that way")
    for one in policies:
        if one.goal is None:
            continue
        missed = float(np.linalg.norm(one.reached.mean(axis=0)[:2] - np.array(one.goal.xy)))
        if missed > 2 * one.goal.within_m:
            said.append(f"{one.name}: simulated whole, it ends {missed:.2f} m from the goal")
    return said


def _gait(shapes: Sequence[str]) -> Gait:
    return Gait(np.array([[float(digit) for digit in shape] for shape in shapes]))


def _as_json(one: Primitive) -> dict[str, Any]:
    values = {name: getattr(one, name) for name in one.__dataclass_fields__}
    return {**values, "gait": list(one.gait.key), "move": one.move.tolist(), "move_sd": one.move_sd.tolist()}


def _from_json(values: Mapping[str, Any]) -> Primitive:
    made = {**values, "gait": _gait(values["gait"])}
    return Primitive(**{**made, "move": np.array(values["move"]), "move_sd": np.array(values["move_sd"])})

"""From gaits and long policies to the artifact and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.stages.plan.groups import (
    LongPolicy,
    gait_figures,
    long_group,
    policy_figures,
    primitives_group,
    symmetry_groups,
)
from r2s2r_cli.stages.plan.robust import Primitive
from r2s2r_cli.stages.plan.route import SIGNS
from r2s2r_cli.stages.plan.runs import played, policy_file, run_groups
from r2s2r_cli.stages.plan.ways import Way
from r2s2r_cli.stages.plan.world import Request, World
from r2s2r_cli.stages.simulate.policies import policy_group
from schemas.config import PlanSettings
from schemas.results_plan import PlanReport


def concluded(
    world: World, request: Request, settings: PlanSettings, saved: Mapping[str, Any],
    primitives: Sequence[Primitive], ways: Sequence[Way],
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
    world: World, request: Request, settings: PlanSettings, primitives: Sequence[Primitive],
    policies: Sequence[LongPolicy],
) -> Sequence[str]:  # fmt: skip
    said = []
    if not request.belief.identified:
        said.append("nothing was identified: the gaits are those of robot.toml's numbers, judged over their priors")
    if world.restless:
        pairs = world.restless + len(world.pairs)
        said.append(f"{world.restless} of {pairs} start poses with drawn numbers do not come to rest: left out. "
                    "Numbers with which the robot may not stand say little of gaits")  # fmt: skip
    if len(world.reference.group) == 1:
        said.append("the robot has no symmetry: a gait serves the triangle that it was found on, and no other")
    if upright := world.reference.upright():
        said.append(f"after {upright} of {len(world.reference.group)} symmetries the mean of the rods' axes stands "
                    "upright: what a gait turns by is not known where it ends on such a triangle")  # fmt: skip
    kept = {name: [one for one in primitives if one.behaviour == name] for name in request.rewards}
    for name, gaits in kept.items():
        if len(gaits) < settings.kept:
            said.append(f"{name}: {len(gaits)} gaits found, {settings.kept} were wanted")
        if gaits and gaits[0].mean <= 0:
            said.append(f"{name}: not even the best gait earns anything: the robot does not move that way")
    named = {one.name for one in policies}
    said += [f"{name}: no sequence of the gaits turns that way: there is no such policy"
             for name in SIGNS if name not in named]  # fmt: skip
    said += [f"{name}: the robot stands there already (--to {goal.typed}): there is no such policy"
             for name, goal in request.goals.items() if name not in named]  # fmt: skip
    for one in policies:
        if one.name in SIGNS and one.reached.mean(axis=0)[2] * SIGNS[one.name] <= 0:
            said.append(f"{one.name}: simulated whole, it turns the other way")
        if one.goal is None and one.far > request.reach:
            said.append(f"{one.name}: comes {one.far:.2f} m from its start, and {request.reach:.2f} m are allowed: "
                        "the camera may lose the robot")  # fmt: skip
        said += [f"{one.name}: {words}" for words in (one.back_again(), one.off_goal()) if words]
    return said

"""`plan`: from what is known of a robot to gaits, long policies of them, and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.checkpoint import Values
from r2s2r_cli.stages.plan.choose import ChoiceSettings, Judge, chosen, shortlist
from r2s2r_cli.stages.plan.conclude import concluded
from r2s2r_cli.stages.plan.gaits import Gait
from r2s2r_cli.stages.plan.robust import Primitive
from r2s2r_cli.stages.plan.search import Search, SearchSettings
from r2s2r_cli.stages.plan.ways import ways
from r2s2r_cli.stages.plan.world import Progress, Request, World
from schemas.config import PlanSettings
from schemas.results_plan import PlanReport
from schemas.robot import Robot

__all__ = ["Request", "plan"]


def plan(
    robot: Robot, request: Request, settings: PlanSettings, *, cache_dir: Path | None = None, threads: int = 1,
    progress: Progress = lambda part, done, total: None, checkpoint: Values | None = None,
) -> tuple[ArtifactData, PlanReport]:  # fmt: skip
    """Search gaits, judge them over what is not known, and make long policies of the best. Layout: `schemas/plan.py`.

    threads: of the engine; the result does not depend on it. Raises InputError for a robot that cannot be planned for,
    NumericalError where no gait is found, or none leads to a goal.
    """
    world = World(robot, request, settings, cache_dir, threads)
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
    long = ways(world, request, settings, primitives, progress)
    return concluded(world, request, settings, saved, primitives, long)


def _searched(world: World, request: Request, settings: PlanSettings, progress: Progress) -> dict[str, Any]:
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


def _gait(shapes: Sequence[str]) -> Gait:
    return Gait(np.array([[float(digit) for digit in shape] for shape in shapes]))


def _as_json(one: Primitive) -> dict[str, Any]:
    values = {name: getattr(one, name) for name in one.__dataclass_fields__}
    return {**values, "gait": list(one.gait.key), "move": one.move.tolist(), "move_sd": one.move_sd.tolist()}


def _from_json(values: Mapping[str, Any]) -> Primitive:
    made = {**values, "gait": _gait(values["gait"])}
    return Primitive(**{**made, "move": np.array(values["move"]), "move_sd": np.array(values["move_sd"])})

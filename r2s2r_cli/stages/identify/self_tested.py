"""`identify --self-test`: the default fit on planted robots in the user's own set-up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.recipe import recipe_of
from r2s2r_cli.stages.identify.request import Progress, Request, silent
from r2s2r_cli.stages.identify.self_test import Fitted, self_test
from r2s2r_cli.stages.identify.task import free_parameters, predictor_of, require_replay
from r2s2r_cli.stages.identify.trusted import sureness
from schemas.config import IdentifySettings
from schemas.results_identify import SelfTestReport
from schemas.robot import Robot


def self_tested(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    settings: IdentifySettings,
    *,
    cache_dir: Path | None = None,
    progress: Progress = silent,
) -> SelfTestReport:
    """Plant known values in the runs that are trained on, fit what `identify` would, from where it would start.

    One start each: ranges and profiles are not part of it. Raises as `identify` and `self_test`.
    """
    require_replay(request)
    recipe = recipe_of(settings)
    frees = free_parameters(robot, runs, request, settings)
    predictor = predictor_of(robot, frees, request, recipe, settings, cache_dir)

    def once(planted: Sequence[RunData]) -> Fitted:
        before = predictor.rollouts
        made = fit(planted, request.train, predictor, recipe, seed=request.seed)
        own = made.solution.z[None, : len(frees)]
        sure = sureness(made, own, loss=recipe.loss, seed=request.seed)
        return Fitted(sure.parameters, made.solution.reason.converged, predictor.rollouts - before)

    trained = {one.run for one in request.train}
    return self_test(
        [run for run in runs if run.name in trained], predictor, once, cases=settings.self_test_cases,
        seed=request.seed, progress=progress,
    )  # fmt: skip

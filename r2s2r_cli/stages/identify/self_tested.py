"""`identify --self-test`: the default fit on planted robots in the user's own set-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.default_method import first_fit
from r2s2r_cli.stages.identify.holding import fitted_to_shown, holding, not_identifiable
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Progress, Request, silent
from r2s2r_cli.stages.identify.rounds import Fit
from r2s2r_cli.stages.identify.self_test import Fitted, self_test
from r2s2r_cli.stages.identify.task import Task, free_parameters, require_replay
from r2s2r_cli.stages.identify.trusted import Sureness, sureness
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

    What the planted runs do not show is held, as there. One start each: ranges and profiles are not part of it.
    Raises as `identify` and `self_test`.
    """
    require_replay(request)
    frees = free_parameters(robot, runs, request, settings)
    task = Task(robot, runs, request, settings, cache_dir)
    predictor = task.predictor(frees)

    def once(planted: Sequence[RunData]) -> Fitted:
        before = predictor.rollouts
        own, begun, _ = holding(replace(task, runs=planted), predictor)

        def make(own: Task, predictor: Predictor) -> tuple[Fit, Sureness]:
            made = first_fit(own, predictor, Kept(None))
            near = made.solution.z[None, : len(frees)]
            return made, sureness(made, near, loss=own.recipe.loss, seed=request.seed)

        _, (made, sure) = fitted_to_shown(own, begun, make, lambda both: not_identifiable(both[1].parameters))
        return Fitted(sure.parameters, made.solution.reason.converged, made.problem.predictor.rollouts - before)

    trained = {one.run for one in request.train}
    return self_test(
        [run for run in runs if run.name in trained], predictor, once, cases=settings.self_test_cases,
        seed=request.seed, progress=progress,
    )  # fmt: skip

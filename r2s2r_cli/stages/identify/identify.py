"""The stage: from runs and a request to the artifact and the report; which method does what was asked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.checkpoint import Values
from r2s2r_cli.stages.identify.closed_method import closed_predictor, find_closed
from r2s2r_cli.stages.identify.cma_method import find_cma
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.default_method import find_default
from r2s2r_cli.stages.identify.found import Found
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.online import find_online, first_free
from r2s2r_cli.stages.identify.paper_method import find_paper, paper_engines
from r2s2r_cli.stages.identify.report import report_of
from r2s2r_cli.stages.identify.request import Progress, Request, silent
from r2s2r_cli.stages.identify.task import Task, require_combination
from schemas.config import IdentifySettings
from schemas.results_identify import IdentifyReport
from schemas.robot import Robot


def identify(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    settings: IdentifySettings,
    *,
    cache_dir: Path | None = None,
    progress: Progress = silent,
    checkpoint: Values | None = None,
) -> tuple[ArtifactData, IdentifyReport]:
    """Identify a robot from its runs; the layout is that of `schemas/identification.py`.

    Raises UsageError for parameters that do not exist, and for a method, drive and --online that do not go together;
    InputError for what the runs cannot show or a start on a bound, NumericalError where nothing can be simulated.
    """
    found = find(robot, runs, request, settings, cache_dir=cache_dir, progress=progress, checkpoint=checkpoint)
    return identification(found), report_of(found)


def find(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    settings: IdentifySettings,
    *,
    cache_dir: Path | None = None,
    progress: Progress = silent,
    checkpoint: Values | None = None,
) -> Found:
    """The same as values: everything that was found."""
    require_combination(request)
    task = Task(robot, runs, request, settings, cache_dir, progress, checkpoint)
    if request.method == "paper":
        return find_paper(task)
    if request.online:
        return find_online(task)
    if request.method == "cma":
        return find_cma(task)
    return find_closed(task) if request.drive == "closed loop" else find_default(task)


def require_possible(robot: Robot, runs: Sequence[RunData], request: Request, settings: IdentifySettings) -> None:
    """Raises what is wrong with a request before anything is simulated, as the method of that request would."""
    require_combination(request)
    task = Task(robot, runs, request, settings)
    if request.method == "paper":
        paper_engines(task)
    elif request.drive == "closed loop":
        closed_predictor(task)
    else:
        task.predictor(first_free(task))


__all__ = ["find", "identify", "require_possible"]

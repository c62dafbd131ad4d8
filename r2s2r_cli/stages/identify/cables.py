"""How much winched cables give way: as robot.toml says, or softer and damped, whichever the training intervals prefer.

The two are far apart and a third number would be a 13th that a crawl does not determine, so both are tried and the
better one is given. On the real crawl softer cables win (docs/concepts/identification.md), on a robot that is as its
robot.toml says those of robot.toml do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.near import Near, near_fit
from r2s2r_cli.stages.identify.task import Task, free_parameters
from r2s2r_cli.stages.identify.training import training_windows
from schemas.identification import FIXED_BY_HAND


def with_cables(task: Task) -> Task:
    """The task with those of both that fit the training intervals better over the first few of them, and with that fit.

    Nothing is tried where the request names these numbers or a set of its own; --online keeps what the estimate that it
    goes on from was made with. Raises NumericalError where neither can be simulated, InputError as the fit does.
    """
    softer = task.softer
    if not softer:
        return task
    if task.request.before is not None:
        table = task.request.before.groups["parameters"]
        given = table["name"][table["trust"] == FIXED_BY_HAND].tolist()
        return replace(task, stock=not {name.encode() for name in softer} & set(given))
    softer_one, stock = (_near(replace(task, stock=stock)) for stock in (False, True))
    if softer_one is None and stock is None:
        raise NumericalError("the training intervals cannot be simulated", where="identify", expected="a finite loss",
                             received="none", hint="r2s2r validate robot.toml")  # fmt: skip
    better = softer_one is None or (stock is not None and stock.solution.cost < softer_one.solution.cost)
    return replace(task, stock=better, near=stock if better else softer_one)


def _near(task: Task) -> Near | None:
    """None where it cannot be simulated to a finite loss."""
    frees = free_parameters(task.robot, task.runs, task.request, task.settings)
    predictor = task.predictor(frees)
    values = np.array([free.start for free in frees])
    try:
        windows = training_windows(task.runs, task.request.train, predictor, values, task.recipe)
        found = near_fit(predictor, windows, values, task.recipe)
    except NumericalError:
        return None
    return found if np.isfinite(found.solution.cost) else None

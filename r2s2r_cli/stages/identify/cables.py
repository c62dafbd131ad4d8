"""How much winched cables give way: as robot.toml says, or softer and damped, whichever the training intervals prefer.

The two are far apart and a third number would be a 13th that a crawl does not determine, so both are tried and the
better one is given. On the real crawl softer cables win (docs/concepts/identification.md), on a robot that is as its
robot.toml says those of robot.toml do.

Stiff cables with little damping make a rough cost: from far off, derivatives get stuck there where softer ones lead on.
So the softer ones come first, and those of robot.toml begin where these came to (docs/concepts/identification.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.near import Near, near_fit, reached
from r2s2r_cli.stages.identify.task import Task, free_parameters
from r2s2r_cli.stages.identify.training import training_windows
from schemas.identification import FIXED_BY_HAND

DOUBT = 10.0
"""[nats] by which softer cables must fit better: robot.toml was written by somebody who has the robot."""


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
    soft, stiff = replace(task, stock=False), replace(task, stock=True)
    softer_one = _near(soft)
    stock = _near(stiff, softer_one)
    if softer_one is None and stock is None:
        raise NumericalError("the training intervals cannot be simulated", where="identify", expected="a finite loss",
                             received="none", hint="r2s2r validate robot.toml")  # fmt: skip
    if not _softer_wins(softer_one, stock):
        # They have begun twice; so may the softer ones.
        again = _near(soft, stock)
        if not _softer_wins(again, stock):
            return replace(stiff, near=stock)
        softer_one = again
    return replace(soft, near=softer_one)


def _softer_wins(softer: Near | None, stock: Near | None) -> bool:
    if softer is None or stock is None:
        return stock is None
    return softer.solution.cost + DOUBT < stock.solution.cost


def _near(task: Task, other: Near | None = None) -> Near | None:
    """From where another fit came to, else from the starts of the parameters. None where it cannot be simulated to a
    finite loss."""
    frees = free_parameters(task.robot, task.runs, task.request, task.settings)
    predictor = task.predictor(frees)
    values = np.array([free.start for free in frees]) if other is None else reached(other)
    try:
        windows = training_windows(task.runs, task.request.train, predictor, values, task.recipe)
        found = near_fit(predictor, windows, values, task.recipe)
    except NumericalError:
        return None
    return found if np.isfinite(found.solution.cost) else None

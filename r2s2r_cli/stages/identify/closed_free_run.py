"""The free run with the controller in the loop: targets of the test intervals, switched when the simulation is done."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import states_at
from r2s2r_cli.stages.measures.steps import Step, chains


def closed_free_run(
    runs: Sequence[RunData], steps: Sequence[Step], predictor: Predictor, values: np.ndarray, recipe: Recipe
) -> tuple[tuple[np.ndarray, ...], list[str]]:
    """End caps (frame, cap, 3) [m] of every chain of steps at its frames, at equal times since its start.

    A simulation that is through before the run ends waits where it is. Empty, with the reason in words, where the
    closed loop cannot be simulated: it never judges a fit.
    """
    import torch

    from r2s2r_cli.engine import EngineError
    from r2s2r_cli.engine.closed_loop import closed_loop

    named = {run.name: run for run in runs}
    x = torch.as_tensor(values, dtype=torch.float64)
    theta = predictor.mapping.theta(x)
    up = np.array([0.0, 0.0, predictor.mapping.observation(values).ground_height])
    limit = predictor.mapping.robot.pid.step_timeout_s
    found = []
    try:
        pid = predictor.mapping.pid(x)
        for chain in chains(steps):
            run = named[chain[0].run]
            last = {run.name: chain[0].interval}
            state = states_at([run], predictor, values, last, belief=recipe.belief)[run.name, chain[0].interval]
            targets = torch.as_tensor(np.array([step.target for step in chain]))
            none = torch.zeros(len(chain), dtype=torch.float64)
            with torch.no_grad():
                done = closed_loop(
                    predictor.simulator, theta, state, pid, targets, none, none + limit, step=predictor.step
                )
            t = np.concatenate([step.t for step in chain]) - chain[0].t[0]
            path, at = done.trajectory.end_caps()[0].numpy(), done.trajectory.t.numpy()
            rows = np.minimum(np.searchsorted(at, t), len(at) - 1)
            found.append(path[rows] + up)
    except EngineError as error:
        return (), [f"the free run with the controller in the loop could not be simulated: {error}"]
    return tuple(found), []

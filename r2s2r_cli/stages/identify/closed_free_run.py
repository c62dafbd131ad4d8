"""The free run with the controller in the loop: targets of the test intervals, switched when the simulation is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.closed_clock import link_between, switches
from r2s2r_cli.stages.identify.closed_sensing import Sensing, measured_sensing, seen_by_camera
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import states_at
from r2s2r_cli.stages.measures.steps import Step, chains

if TYPE_CHECKING:
    from r2s2r_cli.engine import LatchedPid

OF_THE_LOOP = ("camera_delay", "pid_min_length", "pid_range", "pid_tolerance")
"""Numbers that say when a controller sees its cables arrive: where one is given, nothing is measured for it."""


def closed_free_run(
    runs: Sequence[RunData], steps: Sequence[Step], predictor: Predictor, values: np.ndarray, recipe: Recipe,
    train: Sequence[Selection] = (),
) -> tuple[tuple[np.ndarray, ...], list[str]]:  # fmt: skip
    """End caps (frame, cap, 3) [m] of every chain of steps at its frames, at equal times since its start.

    Commands act as late as in command replay. What the controller reads is measured on the training intervals or, where
    `estimate` has compared camera and sensors, over their whole runs, unless a number of the loop is free or fixed. A
    simulation that is through before the run ends waits where it is. Empty, with the reason in words, where the closed
    loop cannot be simulated: it never judges a fit.
    """
    import torch

    from r2s2r_cli.engine import EngineError
    from r2s2r_cli.engine.closed_loop import closed_loop

    mapping = predictor.mapping
    named = {run.name: run for run in runs}
    x = torch.as_tensor(values, dtype=torch.float64)
    theta = mapping.theta(x)
    up = np.array([0.0, 0.0, mapping.observation(values).ground_height])
    limit = mapping.robot.pid.step_timeout_s
    found = []
    try:
        sensing, late = loop_of(runs, train, predictor, values)
        pid = as_read(mapping.pid(x), sensing)
        for chain in chains(steps):
            run, first = named[chain[0].run], chain[0].interval
            state = states_at([run], predictor, values, {run.name: first}, belief=recipe.belief)[run.name, first]
            targets = torch.as_tensor(np.array([step.target for step in chain]))
            none = torch.zeros(len(chain), dtype=torch.float64)
            link = link_between(
                run, float(chain[0].t[0]), float(switches(run).at[first - 1]), period=pid.period,
                command_delay=np.array([late]), camera_delay=np.array([sensing.camera_delay]),
            )  # fmt: skip
            with torch.no_grad():
                done = closed_loop(
                    predictor.simulator, theta, state, pid, targets, none, none + limit, step=predictor.step, link=link
                )
            t = np.concatenate([step.t for step in chain]) - chain[0].t[0]
            path, at = done.trajectory.end_caps()[0].numpy(), done.trajectory.t.numpy()
            rows = np.minimum(np.searchsorted(at, t), len(at) - 1)
            found.append(path[rows] + up)
    except EngineError as error:
        return (), [f"the free run with the controller in the loop could not be simulated: {error}"]
    return tuple(found), []


def loop_of(
    runs: Sequence[RunData], train: Sequence[Selection], predictor: Predictor, values: np.ndarray
) -> tuple[Sensing, float]:
    """What the controller reads, and how late its commands reach the winches [s].

    Command replay knows how late a command is seen to act, and that is kept: what is measured says which part of it is
    before the camera. Where a camera looked at the sensors, it says better how they err, and how late they read: what
    the controller does is late by that and by what a command takes, whatever the camera's clock shows.
    """
    mapping = predictor.mapping
    seen = mapping.observation(values)
    total = seen.command_delay + seen.camera_delay
    given = {*mapping.names, *mapping.fixed}
    if given & set(OF_THE_LOOP):
        return Sensing(seen.camera_delay, np.zeros(len(mapping.robot.actuated))), seen.command_delay
    sensing = measured_sensing(mapping.robot, runs, train, camera_delay=seen.camera_delay, most=total)
    bias, behind = seen_by_camera(mapping.robot, runs, train)
    if np.isfinite(bias).any():
        sensing = replace(sensing, bias=np.where(np.isfinite(bias), bias, sensing.bias), by_camera=True)
    if behind is not None:
        return replace(sensing, camera_delay=-behind), max(total + behind, 0.0)
    return sensing, max(total - sensing.camera_delay, 0.0)


def as_read(pid: LatchedPid, sensing: Sensing) -> LatchedPid:
    """The controller with the errors of its sensors: a cable that reads longer is at position 0 where it is shorter."""
    import torch

    return replace(pid, min_length=pid.min_length - torch.as_tensor(sensing.bias)[None])

"""Start states of windows, from frames at or before the start only: a filter with the simulator as its motion model.

Roll, rest lengths and slack are not observable in a frame; a simulation carries them. A frame alone is no start either:
where a tracker jumps, it is off by centimetres. So the robot is simulated from interval to interval, and at each start the
simulated pose is corrected by the last frames, cap by cap, with a likelihood whose tails are heavy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.offsets import displaced
from r2s2r_cli.stages.identify.predict import Predictor, refused
from r2s2r_cli.stages.init.attachment import rod_frames

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State

DOF = 4.0
"""Of the Student t likelihood of an observed cap: one that is off by 5 sd pulls like one that is off by 2."""
GROUND_SD = 5e-4
"""[m] a cap of the corrected pose reaches into the ground by no more than this."""
ITERATIONS = 15


@dataclass(frozen=True)
class Filter:
    """What the filter believes of its parts.

    frames: how many of the last frames correct a start. noise: least sd of an observed coordinate [m]. position [m],
    tilt, roll [rad]: sd of each rod's simulated pose after one interval. held, moved: sd of the length of a cable whose
    motor stood still, or turned, in the interval before [m].
    """

    frames: int = 4
    noise: float = 2e-3
    position: float = 8e-3
    tilt: float = 0.03
    roll: float = 0.02
    held: float = 2e-3
    moved: float = 5e-3


def start_states(
    run: RunData, predictor: Predictor, values: np.ndarray, last: int, *, belief: Filter | None = None
) -> list[State]:
    """States at the first frames of intervals 1 to `last`, each a batch of 1.

    The first is the robot at rest in the observed pose (paper, section System Identification: cable lengths and end caps
    at t = 0, then gravity), from the run's first frame. Raises NumericalError, InputError where that cannot be.
    """
    import torch

    from r2s2r_cli.engine import EngineError

    belief = belief or Filter()
    mapping, simulator = predictor.mapping, predictor.simulator
    theta = mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    seen = mapping.observation(values)
    observed = run.observed - np.array([0.0, 0.0, seen.ground_height])
    log, delay = CommandLog(run), seen.command_delay + seen.camera_delay
    first = run.intervals.first
    states: list[State] = []
    try:
        with torch.no_grad():
            states.append(_rest(predictor, theta, observed[first[0]]))
            for k in range(1, last):
                start, end = float(run.t[first[k - 1]]), float(run.t[first[k]])
                count = max(1, round((end - start) / predictor.step))
                u, _ = log.rows(start, count, step=predictor.step, delay=delay)
                path = simulator.rollout(theta, states[-1], torch.as_tensor(u)[None], step=predictor.step)
                frames = np.arange(max(first[k - 1] + 1, first[k] + 1 - belief.frames), first[k] + 1)
                rows = np.minimum(np.round((run.t[frames] - start) / predictor.step).astype(int), count)
                moved = np.abs(u).max(axis=0) > 0
                states.append(
                    _corrected(
                        predictor, theta, path.at(count), path.end_caps()[0, rows], observed[frames],
                        np.maximum(run.noise, belief.noise), np.where(moved, belief.moved, belief.held), belief,
                    )
                )  # fmt: skip
    except EngineError as error:
        raise refused(error, ()) from error
    return states


def _rest(predictor: Predictor, theta: Parameters, p_WE: np.ndarray) -> State:
    """The robot at rest in an observed pose; its caps stay where they were seen."""
    import torch

    from r2s2r_cli.engine.settle import settled, window_state

    caps = torch.as_tensor(p_WE)[None]
    found = settled(
        predictor.simulator, theta, caps, torch.as_tensor(rod_frames(p_WE))[None], predictor.cable_caps,
        step=predictor.step,
    )  # fmt: skip
    return window_state(predictor.simulator, theta, caps, found.state, v_WE=torch.zeros_like(caps))


def _corrected(
    predictor: Predictor,
    theta: Parameters,
    state: State,
    path: Tensor,
    observed: np.ndarray,
    noise: np.ndarray,
    lengths_sd: np.ndarray,
    belief: Filter,
) -> State:
    """A simulated state moved towards the observed caps (frame, cap, 3) of its last frames; path: simulated ones.

    Maximum a posteriori over the pose of each rod (Gauss-Newton, reweighted). The motion between the frames and the
    start is the simulated one. Rest lengths follow the corrected pose where tensions balance it.
    """
    import torch
    from torch.func import jacfwd

    from r2s2r_cli.engine import end_caps
    from r2s2r_cli.engine.flat import pack_state, unpack_state
    from r2s2r_cli.engine.reading import cap_lengths
    from r2s2r_cli.engine.settle import consistent, lowered

    structure, rods = predictor.structure, predictor.structure.n_rods
    winched = list(structure.actuated)
    flat, here = pack_state(structure, state), end_caps(theta, state)
    seen = torch.as_tensor(observed) - (path - here)
    sd, radius = torch.as_tensor(noise), theta.cap_radius.flatten()
    lengths = cap_lengths(predictor.cable_caps, here)[0, winched]
    length_sd = torch.as_tensor(lengths_sd)
    sides = np.concatenate([np.full(3 * rods, belief.position), np.tile([belief.tilt, belief.tilt, belief.roll], rods)])
    prior = torch.as_tensor(sides)

    def moved(n: Tensor) -> Tensor:
        return displaced(structure, flat, torch.cat([n, n.new_zeros(6 * rods + structure.n_actuated)])[None])

    def residuals(n: Tensor) -> tuple[Tensor, Tensor]:
        caps = end_caps(theta, unpack_state(structure, moved(n)))
        now = cap_lengths(predictor.cable_caps, caps)[0, winched]
        below = torch.relu(radius - caps[0, :, 2]) / GROUND_SD
        return (caps - seen) / sd, torch.cat([n / prior, (now - lengths) / length_sd, below])

    n = prior.new_zeros(len(prior))
    for _ in range(ITERATIONS):
        r, others = residuals(n)
        d_r, d_others = jacfwd(residuals)(n)
        weight = ((DOF + 3) / (DOF + (r**2).sum(-1)))[..., None].expand_as(r).reshape(-1)
        d_r = d_r.reshape(-1, len(n))
        normal = d_r.T @ (d_r * weight[:, None]) + d_others.T @ d_others
        step = torch.linalg.solve(normal, d_r.T @ (weight * r.reshape(-1)) + d_others.T @ others)
        n = n - step
        if float(step.abs().max()) < 1e-7:
            break
    corrected = lowered(theta, unpack_state(structure, moved(n)), only_up=True)
    return consistent(structure, theta, corrected, slack=state.rest)


def states_at(
    runs: Sequence[RunData], predictor: Predictor, values: np.ndarray, last: dict[str, int], *,
    belief: Filter | None = None,
) -> dict[tuple[str, int], State]:  # fmt: skip
    """Start states by run and interval (1-based), of intervals 1 to last[run]. Raises as `start_states`."""
    found: dict[tuple[str, int], State] = {}
    for run in runs:
        for k, state in enumerate(start_states(run, predictor, values, last[run.name], belief=belief)):
            found[run.name, k + 1] = replace(state)
    if not found:
        raise NumericalError("there is nothing to start from", where="identify", expected="a run", received="none",
                             hint="r2s2r status")  # fmt: skip
    return found

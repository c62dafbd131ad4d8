"""Where target intervals start: the filter of `identify`, on fewer frames and with the pose at rest found once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.identify.belief import Filter
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.predict import Predictor, refused
from r2s2r_cli.stages.identify.start import _Ensemble, _rest

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

APART_S = 0.25
"""Frames that the filter looks at are at least so far apart: by its own belief errors of a tracker last 0.5 s, and
frames nearer than that say little more."""
LOOSE_SD, LOOSE_M = 3.0, 3e-3
"""Standard deviations of a distance, and the least, beyond which a cable hangs."""

STANDING = 1.5
"""Standard deviations above the ground up to which a cap stands on it."""


class Starts:
    """Start states of intervals, by run and number. The robot at rest before a run is found once: how it stands hangs
    little on numbers that are fitted."""

    def __init__(self, belief: Filter) -> None:
        self.belief = belief
        self._rest: dict[str, State] = {}
        self._thin: dict[str, RunData] = {}

    def at(
        self, runs: Sequence[Run], predictor: Predictor, values: np.ndarray, last: dict[str, int]
    ) -> dict[tuple[str, int], State]:
        """Of intervals 1 to last[run]; none depends on a later frame. Raises NumericalError where the robot cannot be
        simulated."""
        import torch

        from r2s2r_cli.engine import EngineError

        theta = predictor.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
        up = np.array([0.0, 0.0, predictor.mapping.observation(values).ground_height])
        found: dict[tuple[str, int], State] = {}
        for run in runs:
            if run.name not in last:
                continue
            caps = self._thin.setdefault(run.name, thinned(run.caps))
            try:
                with torch.no_grad():
                    if run.name not in self._rest:
                        self._rest[run.name] = _rest(predictor, theta, caps.observed[caps.intervals.first[0]] - up)
                    rest = self._rest[run.name]
                    states = [rest]
                    if last[run.name] > 1:
                        later = _Ensemble(caps, predictor, values, rest, self.belief).starts()
                        states += (start.state for start in islice(later, last[run.name] - 1))
            except EngineError as error:
                raise refused(error, ()) from error
            found.update({(run.name, k + 1): state for k, state in enumerate(states)})
        return found


def as_known(
    states: dict[tuple[str, int], State], runs: Sequence[Run], predictor: Predictor, values: np.ndarray
) -> dict[tuple[str, int], State]:
    """The states in the poses and with the velocities that were known by then (`Run.known`). Roll is the filter's; rest
    lengths balance the pose."""
    named = {run.name: run for run in runs}
    at = [(named[name], int(named[name].caps.intervals.first[number - 1])) for name, number in states]
    if not at:
        return {}
    found = known_at(at, batched(list(states.values())), predictor, values)
    return {place: found.select(k) for k, place in enumerate(states)}


def known_at(at: Sequence[tuple[Run, int]], carried: State, predictor: Predictor, values: np.ndarray) -> State:
    """States (a batch) in the poses and with the velocities known at frames of runs; what these do not show is that of
    `carried`, a batch as well. A cap that may well stand on the ground does: else noise would lift the robot."""
    import torch

    from r2s2r_cli.engine.settle import window_state

    theta = predictor.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    up = np.array([0.0, 0.0, predictor.mapping.observation(values).ground_height])
    radius = theta.cap_radius.flatten().numpy()
    caps = np.array([run.known.p_WE[frame] - up for run, frame in at])
    sd = np.array([run.known.sd_p[frame, :, 2] for run, frame in at])
    caps[..., 2] = np.where(caps[..., 2] < radius + STANDING * sd, radius, caps[..., 2])
    with torch.no_grad():
        return window_state(
            predictor.simulator, theta, torch.as_tensor(caps), carried,
            v_WE=torch.as_tensor(np.array([run.known.v_WE[frame] for run, frame in at])),
            loose=float(np.mean([loose(run, frame) for run, frame in at])),
        )  # fmt: skip


def batched(states: Sequence[State]) -> State:
    """Single states as one batch."""
    import torch

    named = {
        f.name: torch.cat([getattr(one, f.name) for one in states]) for f in fields(states[0]) if f.name != "extra"
    }
    return replace(
        states[0], **named, extra={name: torch.cat([one.extra[name] for one in states]) for name in states[0].extra}
    )


def loose(run: Run, frame: int) -> float:
    """How much longer than the distance seen at a frame a rest length must be before the cable surely hangs [m]."""
    return max(LOOSE_M, LOOSE_SD * float(np.sqrt(2.0 * np.mean(run.known.sd_p[frame] ** 2))))


def thinned(run: RunData) -> RunData:
    """The run with the first frame of every interval and, between these, frames at least APART_S apart."""
    first = {int(frame) for frame in run.intervals.first}
    kept: list[int] = []
    for k in range(len(run.t)):
        if k in first or not kept or run.t[k] - run.t[kept[-1]] >= APART_S:
            kept.append(k)
    rows = np.array(kept)
    place = {frame: k for k, frame in enumerate(kept)}
    intervals = replace(
        run.intervals, first=np.array([place[int(frame)] for frame in run.intervals.first]),
        last=np.array([int(np.searchsorted(rows, frame, side="right")) - 1 for frame in run.intervals.last]),
    )  # fmt: skip
    return replace(
        run, t=run.t[rows], observed=run.observed[rows], p_WE=run.p_WE[rows], sd_p=run.sd_p[rows], v_WE=run.v_WE[rows],
        sd_v=run.sd_v[rows], quality=run.quality[rows], intervals=intervals,
    )  # fmt: skip

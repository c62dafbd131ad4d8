"""Start states of intervals, from frames up to the start only: an ensemble Kalman filter that simulates the run.

Roll, rest lengths and velocities are not seen in a frame, and a frame alone is no start: where a tracker jumps, it is
off by centimetres. So members are simulated from frame to frame with numbers a little different from each other's, and
every frame pulls them towards it. What is not seen follows through its covariance with what is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.belief import Filter, Spread
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.ensemble import analysis, centred, student_weights
from r2s2r_cli.stages.identify.members import mean, placed, places
from r2s2r_cli.stages.identify.predict import Predictor, refused
from r2s2r_cli.stages.identify.ways import Start, Way
from r2s2r_cli.stages.init.attachment import rod_frames

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State

LOST_SHARE = 0.5
"""Of the members: if more leave the finite numbers in a step, it is not they but the simulator."""


def starts_to(
    run: RunData, predictor: Predictor, values: np.ndarray, last: int, *, belief: Filter | None = None
) -> list[Start]:
    """Starts at the first frames of intervals 1 to `last`; none depends on a later frame.

    The first is the robot at rest in the observed pose (paper, section System Identification: cable lengths and end
    caps at t = 0, then gravity), from the run's first frame. The others are means of an ensemble.
    The predictor keeps those of the last values: asked again, nothing is simulated twice.
    Raises NumericalError, InputError where the robot cannot be simulated.
    """
    import torch

    from r2s2r_cli.engine import EngineError

    belief = belief or Filter()
    way = predictor.ways.get(run.name)
    if way is None or not way.same(run, values, belief):
        way = predictor.ways[run.name] = Way(run, values.copy(), belief, _coming(run, predictor, values, belief))
    try:
        with torch.no_grad():
            way.found.extend(islice(way.coming, max(last - len(way.found), 0)))
    except BaseException as error:
        del predictor.ways[run.name]  # a filter that was broken off does not go on
        if isinstance(error, EngineError):
            raise refused(error, ()) from error
        raise
    return way.found[:last]


def start_states(
    run: RunData, predictor: Predictor, values: np.ndarray, last: int, *, belief: Filter | None = None
) -> list[State]:
    """The states of `starts_to`, each a batch of 1. Raises as it does."""
    return [start.state for start in starts_to(run, predictor, values, last, belief=belief)]


def _coming(run: RunData, predictor: Predictor, values: np.ndarray, belief: Filter) -> Iterator[Start]:
    """The starts, each simulated when it is asked for."""
    import torch

    theta = predictor.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    up = np.array([0.0, 0.0, predictor.mapping.observation(values).ground_height])
    rest = _rest(predictor, theta, run.observed[run.intervals.first[0]] - up)
    yield Start(rest)
    if len(run.intervals) > 1:
        yield from _Ensemble(run, predictor, values, rest, belief).starts()


def states_at(
    runs: Sequence[RunData], predictor: Predictor, values: np.ndarray, last: dict[str, int], *,
    belief: Filter | None = None,
) -> dict[tuple[str, int], State]:  # fmt: skip
    """Start states by run and interval (1-based), of intervals 1 to last[run]. Raises as `starts_to`."""
    found = starts_at(runs, predictor, values, last, belief=belief)
    return {place: start.state for place, start in found.items()}


def starts_at(
    runs: Sequence[RunData], predictor: Predictor, values: np.ndarray, last: dict[str, int], *,
    belief: Filter | None = None,
) -> dict[tuple[str, int], Start]:  # fmt: skip
    """Starts by run and interval (1-based), of intervals 1 to last[run]. Raises as `starts_to`."""
    found: dict[tuple[str, int], Start] = {}
    for run in runs:
        for k, start in enumerate(starts_to(run, predictor, values, last[run.name], belief=belief)):
            found[run.name, k + 1] = start
    if not found:
        raise NumericalError("there is nothing to start from", where="identify", expected="a run", received="none",
                             hint="r2s2r status")  # fmt: skip
    return found


def _rest(predictor: Predictor, theta: Parameters, p_WE: np.ndarray) -> State:
    """The robot at rest in an observed pose; its caps stay where they were seen."""
    import torch

    from r2s2r_cli.engine.late import unseen
    from r2s2r_cli.engine.settle import settled, window_state

    caps = unseen(predictor.structure, theta, torch.as_tensor(p_WE)[None])
    p_WE = caps[0].numpy()
    found = settled(
        predictor.simulator, theta, caps, torch.as_tensor(rod_frames(p_WE))[None], predictor.cable_caps,
        step=predictor.step,
    )  # fmt: skip
    return window_state(predictor.simulator, theta, caps, found.state, v_WE=torch.zeros_like(caps))


class _Ensemble:
    """Members (E, NS) on their way through one run, from a state of batch 1 at the first frame of interval 1."""

    def __init__(self, run: RunData, predictor: Predictor, values: np.ndarray, state: State, belief: Filter) -> None:
        import torch

        from r2s2r_cli.engine.flat import pack_state
        from r2s2r_cli.engine.hooks import effective

        mapping = predictor.mapping
        seen = mapping.observation(values)
        self.run, self.belief, self.structure = run, belief, predictor.structure
        self.simulator, self.step = predictor.simulator, predictor.step
        self.theta = mapping.theta(torch.as_tensor(values, dtype=torch.float64))
        self.in_view = effective(self.structure, self.theta)
        self.ground = np.array([0.0, 0.0, seen.ground_height])
        self.delay = seen.command_delay + seen.camera_delay
        self.substeps = self.simulator.substeps(self.theta, state, self.step)
        self.rng = np.random.default_rng(belief.seed)
        self.places = places(self.structure)
        self.flat = pack_state(self.structure, state).expand(belief.members, -1)
        self._add(belief.first)
        self._redraw()

    def starts(self) -> Iterator[Start]:
        """Where intervals 2, 3 and so on start."""
        from r2s2r_cli.engine.flat import unpack_state

        run, first = self.run, [int(frame) for frame in self.run.intervals.first]
        t = run.t[first[0] : first[-1] + 1] - run.t[first[0]]
        at = np.round(t / self.step).astype(int)
        u = CommandLog(run).means(float(run.t[first[0]]), int(at[-1]), step=self.step, delay=self.delay)
        for k in range(1, len(at)):
            self._simulate(u[at[k - 1] : at[k]])
            self._add(self.belief.drift, math.sqrt(t[k] - t[k - 1]))
            self._see(first[0] + k, float(t[k] - t[k - 1]))
            if first[0] + k in first:
                yield Start(unpack_state(self.structure, mean(self.structure, self.flat)[0][None]), self.flat)
                self._add(self.belief.interval)
                self._redraw()

    def _simulate(self, u: np.ndarray) -> None:
        """All members under the commands u (row, actuated)."""
        import torch

        from r2s2r_cli.engine.nonfinite import require_finite

        if len(u) == 0:
            return
        rows = torch.as_tensor(u)[None].expand(len(self.flat), -1, -1)
        h, hold, every = self.step / self.substeps, self.substeps, self.substeps * len(u)
        frames = self.simulator.advance(self.flat, rows, self.packed, h=h, hold=hold, every=every)
        lost = ~frames.isfinite().all(dim=-1).all(dim=-1)
        if lost.sum() > LOST_SHARE * len(lost):
            require_finite(
                self.structure, self.simulator.kernels.fn, frames, rows, self.packed, h=h, hold=hold, every=every
            )
        self.flat = frames[:, -1]
        if lost.any():
            # Drawn where no robot is, such as a cap deep in the ground: another member stands in.
            kept = np.flatnonzero(~lost.numpy())
            self.flat = self.flat.clone()
            self.flat[lost] = self.flat[torch.as_tensor(self.rng.choice(kept, int(lost.sum())))]

    def _see(self, frame: int, since: float) -> None:
        """Analysis of one frame, `since` seconds after the one before."""
        import torch

        from r2s2r_cli.engine import end_caps, observe
        from r2s2r_cli.engine.flat import unpack_state

        reference, deviation = mean(self.structure, self.flat)
        caps = end_caps(self.in_view, unpack_state(self.structure, self.flat))
        now = torch.zeros(1, dtype=caps.dtype)
        p_WE = observe(self.structure, self.in_view, now, caps[:, None])[:, 0].numpy() + self.ground
        middle = p_WE.mean(axis=0)
        innovation, seen = self.run.observed[frame] - middle, p_WE - middle
        white = self.run.sd_at(frame, self.belief.noise) ** 2
        # n frames of errors with this memory say as much as n / (1 + 2 persistence / since) independent ones
        variance = white * (1 + 2 * self.belief.persistence / since)
        weight = student_weights(innovation, seen, variance, self.belief.dof)
        members = len(deviation)
        shift, deviation = analysis(
            deviation, seen.reshape(members, -1), innovation.reshape(-1), (variance / weight[:, None]).reshape(-1)
        )
        self.flat = placed(self.structure, reference, shift + deviation)

    def _add(self, spread: Spread, times: float = 1.0) -> None:
        """Scatter the members by `spread`."""
        rods, members = self.structure.n_rods, len(self.flat)
        sd = np.zeros(max(one.stop for one in self.places.values()))
        sd[self.places["p_WB"]] = spread.position
        sd[self.places["q_WR"]] = np.tile([spread.tilt, spread.tilt, spread.roll], rods)
        sd[self.places["rest"]] = spread.rest
        self.flat = placed(self.structure, self.flat, times * sd * centred(self.rng, members, len(sd)))

    def _redraw(self) -> None:
        """New motor rates and friction for every member."""
        import torch

        from r2s2r_cli.engine.flat import pack_parameters

        def scattered(tensor: Tensor, sd: float) -> Tensor:
            draws = centred(self.rng, self.belief.members, tensor[0].numel())
            return tensor * torch.as_tensor(np.exp(sd * draws)).view(-1, *tensor.shape[1:])

        theta, belief = self.theta, self.belief
        drawn = {
            "speed_in": scattered(theta.speed_in, belief.speed), "speed_out": scattered(theta.speed_out, belief.speed),
            "friction": scattered(theta.friction, belief.friction),
        }  # fmt: skip
        self.packed = pack_parameters(self.structure, theta.with_values(drawn))

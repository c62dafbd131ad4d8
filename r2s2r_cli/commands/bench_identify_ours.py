"""This project's fit on a case of `bench identify`: its data from the engine, its fit, its intervals."""

from __future__ import annotations

import math
import time
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.commands.bench_identify_case import FRAME_S, NOISE_M, NUMBERS, Case, Fit
from r2s2r_cli.commands.bench_sides import SETTLE_S

if TYPE_CHECKING:
    from r2s2r_cli.engine import State
    from r2s2r_cli.stages.identify.data import RunData
    from r2s2r_cli.stages.identify.free import Free, Mapping
    from r2s2r_cli.stages.identify.offsets import StartSpread
    from r2s2r_cli.stages.identify.predict import Predictor
    from r2s2r_cli.stages.identify.recipe import Recipe
    from schemas.robot import Robot

VELOCITY, RATE = 0.02, 0.1
"""Standard deviations of what is unknown of the start in the hard problem, per axis of a rod: [m/s], [rad/s]."""
PHASE = 0.2
"""[rad] attachment points are turned about their rod by at most so much in the hard problem."""
RUN = "gait"


def predictor_of(robot: Robot, *, hard: bool = False, step: float = 1e-3) -> Predictor:
    """The simulator of all cases of one robot, on one thread: compiled once. hard: attachment phases are free too;
    step: of the engine [s]."""
    import torch

    from r2s2r_cli.stages.identify.free import Mapping, select
    from r2s2r_cli.stages.identify.predict import Predictor

    torch.set_num_threads(1)
    phases = tuple(f"attachment_phase.{rod}" for rod in range(len(robot.rods)) if hard)
    return Predictor(Mapping(robot, select((*NUMBERS, *phases), robot)), step=step, threads=1)


class OurSide:
    """A case as `identify` takes it: the robot simulated with the planted values, from rest, as it is observed.

    truth: planted values of all free numbers, those of the case first, then attachment phases where they are free. Then
    the robot also starts with velocities that nobody knows.
    """

    def __init__(self, case: Case, predictor: Predictor) -> None:
        from r2s2r_cli.stages.identify.windows import window

        self.case, self.frees = case, _frees(case, predictor.mapping)
        self.predictor = _with_frees(predictor, self.frees)
        hard = len(self.frees) > len(NUMBERS)
        draw = np.random.default_rng([case.seed, 6])
        phases = PHASE * draw.uniform(-1.0, 1.0, len(self.frees) - len(NUMBERS))
        self.truth = np.concatenate([case.truth, phases])
        self.spread = _start_spread() if hard else None
        offsets = None
        if self.spread is not None:
            sd = self.spread.sd(predictor.structure)
            offsets = (sd * draw.standard_normal(len(sd)))[None]
        state = self._at_rest()
        blank = np.zeros((len(case.t) + 1, *case.noise.shape[1:]))
        whole = tuple(range(1, 1 + math.ceil(case.t[-1] / bench_gait.TARGET_S)))
        clean = predictor.predict([window(_recorded(case, blank), whole, state)], self.truth, offsets).p_WE
        # The first frame is the start, which is given: nothing is compared there.
        run = _recorded(case, np.concatenate([clean[:1], clean + case.noise]))
        self.window = window(run, whole, state, known=not hard)

    def fit(self) -> Fit:
        """The first round of `identify`, whose starts and noise are those of the case, and its intervals.

        The noise is normal, yet a robust loss finds more: where a wrong robot tips over, it does not pull.

        Raises NumericalError where the start cannot be simulated.
        """
        from r2s2r_cli.stages.identify.rounds import first_round
        from r2s2r_cli.stages.identify.settled import spread_of
        from r2s2r_cli.stages.identify.solve.loss import LOSSES

        clock, before, recipe = time.process_time(), self.predictor.rollouts, self.recipe()
        start = np.array([free.start for free in self.frees])
        found = first_round(self.predictor, [self.window], start, recipe, seed=self.case.seed)
        trust = spread_of(found.problem, found.solution, LOSSES[recipe.loss], found.drawn)
        residual = found.solution.residual
        return Fit(estimate=trust.value, low=trust.lower, high=trust.upper, cpu_s=time.process_time() - clock,
                   rollouts=float(self.predictor.rollouts - before),
                   rms_m=NOISE_M * float(np.sqrt(np.mean(residual**2))))  # fmt: skip

    def recipe(self) -> Recipe:
        """That of `identify`, with the noise of the case and with what is unknown of its start."""
        from r2s2r_cli.stages.identify.offsets import StartSpread
        from r2s2r_cli.stages.identify.recipe import Recipe

        return Recipe(noise=NOISE_M, spread=self.spread or StartSpread())

    def _at_rest(self) -> State:
        import torch

        from r2s2r_cli.stages.model import rest_state

        ours = self.predictor
        hold = round(bench_gait.TICK_S / ours.step)
        still = torch.zeros(1, round(SETTLE_S / bench_gait.TICK_S), ours.structure.n_actuated, dtype=torch.float64)
        theta = ours.mapping.theta(self.truth)
        run = ours.simulator.rollout(theta, rest_state(self.case.nominal), still, step=ours.step, hold=hold, every=hold)
        return run.at(-1)


def _frees(case: Case, mapping: Mapping) -> tuple[Free, ...]:
    """The free numbers of the catalogue with the starts and bounds of the case; the widths of their priors stay."""
    own = zip(mapping.frees, case.start, case.lower, case.upper, strict=False)
    given = tuple(replace(free, start=float(x), lower=float(a), upper=float(b)) for free, x, a, b in own)
    return (*given, *mapping.frees[len(given) :])


def _with_frees(predictor: Predictor, frees: tuple[Free, ...]) -> Predictor:
    """The same compiled simulator with other starts and bounds of the same free numbers."""
    found = copy(predictor)
    found.mapping = copy(predictor.mapping)
    found.mapping.frees = frees
    return found


def _start_spread() -> StartSpread:
    """Standard deviations of the offsets of a start: its pose is known, its velocities are not."""
    from r2s2r_cli.stages.identify.offsets import StartSpread

    return StartSpread(position=0.0, tilt=0.0, roll=0.0, rest=0.0, velocity=VELOCITY, tilt_rate=RATE, roll_rate=RATE)


def _recorded(case: Case, p_WE: np.ndarray) -> RunData:
    """A run with these end caps (frame, cap, 3) [m], the first of them at its start: commands as they were sent, a
    target interval a second, nothing smoothed."""
    from r2s2r_cli.stages.identify.data import RunData
    from r2s2r_cli.stages.segments import Intervals, segments

    t = np.concatenate([[0.0], case.t])
    t_command = bench_gait.TICK_S * np.arange(len(case.u))
    first = np.arange(0, len(t) - 1, round(bench_gait.TARGET_S / FRAME_S))
    last = np.append(first[1:] - 1, len(t) - 1)
    ticks = np.round(t[first] / bench_gait.TICK_S).astype(int)
    target = (case.u[ticks] <= 0).astype(float)
    intervals = Intervals(first=first, last=last, t_first=t[first], t_last=t[last], target=target,
                          complete=np.ones(len(first), dtype=bool))  # fmt: skip
    held = np.searchsorted(ticks, np.arange(len(case.u)), side="right") - 1
    sd = np.full_like(p_WE, NOISE_M)
    return RunData(
        name=RUN, t=t, observed=p_WE, noise=np.full(p_WE.shape[1:], NOISE_M), p_WE=p_WE, sd_p=sd,
        v_WE=np.gradient(p_WE, t, axis=0), sd_v=sd / FRAME_S, quality=np.zeros(p_WE.shape[:2], dtype=np.uint8),
        t_command=t_command, control=case.u, target=target[held], intervals=intervals, segments=segments(intervals, t),
    )  # fmt: skip

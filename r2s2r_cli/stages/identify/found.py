"""Everything that one identification found, before it is written down: what `groups` and `report` are made from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.stages.identify.closed_sensing import Sensing
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.repeating import Repeats
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.trust.covariance import correlation_of
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust
from r2s2r_cli.stages.measures.floor import Floor
from r2s2r_cli.stages.measures.keyframes import frame_rmse
from r2s2r_cli.stages.measures.steps import Step
from r2s2r_cli.stages.measures.table import Row

OURS = "identified"
"""Name of our own row in the tables of predictors: the simulator with the identified numbers."""
REPEATS = "identified + what repeats"
"""The same with the discrepancy of `repeating` added, which is no physics."""


@dataclass(frozen=True)
class ParameterFound:
    """One number, all in its unit. trust: None where it was fixed by hand.

    sd, lower, upper: NaN where there is none; never written down for a number that the runs do not determine. range:
    NaN where nobody looked.
    """

    free: Free
    value: float
    sd: float
    lower: float
    upper: float
    range: tuple[float, float]
    trust: Trust | None
    reason: str = ""

    @property
    def identifiable(self) -> bool:
        """Whether the runs determine the number, if perhaps badly."""
        return self.trust not in (None, Trust.NOT_IDENTIFIABLE)

    @property
    def interval(self) -> tuple[float, float, float]:
        """sd, lower and upper end, NaN unless identifiable."""
        return (self.sd, self.lower, self.upper) if self.identifiable else (math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class TraceStep:
    """One accepted step. value: (n,) in units, or None where the method keeps none."""

    start: int
    stage: str
    iteration: int
    cost: float
    value: np.ndarray | None = None


@dataclass(frozen=True)
class StartFound:
    """One fit. first, last: (n,) in units."""

    first: np.ndarray
    last: np.ndarray
    cost: float
    iterations: int
    reason: str


@dataclass(frozen=True)
class ProfileFound:
    """Profile likelihood of parameter `row`: grid (k,) in its unit, rise of the cost (k,), 95 % interval or NaN.

    threshold: rise at the ends of the interval. words: how it differs from the interval of the covariance.
    """

    row: int
    value: np.ndarray
    cost: np.ndarray
    interval: tuple[float, float]
    threshold: float = 1.92
    words: str = ""


@dataclass(frozen=True)
class WindowFound:
    """Fitted start state of one training window: end caps p_WE, v_WE (cap, 3) [m], [m/s]; shift: minus the estimate."""

    run: str
    interval: int
    t_first: float
    t_last: float
    p_WE: np.ndarray
    v_WE: np.ndarray
    shift: np.ndarray


@dataclass(frozen=True)
class SegmentFound:
    """One target interval from its own start. simulated: (frame, cap, 3) [m] at the frames of the step. lag1, white:
    (cap,), of the residuals, see `trust.whiteness`."""

    step: Step
    simulated: np.ndarray
    lag1: np.ndarray
    white: np.ndarray

    @property
    def keyframe_error(self) -> np.ndarray:
        """Simulated minus observed end caps at the key frame, (cap, 3) [m]."""
        return np.asarray(self.simulated[-1] - self.step.key)

    @property
    def keyframe_cap_rmse(self) -> float:
        """Root mean square over caps of its length [m]."""
        return float(np.sqrt(np.sum(self.keyframe_error**2, axis=-1).mean()))

    @property
    def cap_rmse(self) -> float:
        """Root mean square over frames and caps of the distance [m]."""
        return float(np.sqrt(np.mean(frame_rmse(self.step.p_WE, self.simulated) ** 2)))


@dataclass(frozen=True)
class FreeRunFound:
    """Test intervals that follow each other, from one start: t (frame,) [s], end caps (frame, cap, 3) [m]; predicted:
    simulated, with what repeats."""

    run: str
    t: np.ndarray
    observed: np.ndarray
    simulated: np.ndarray
    closed_loop: np.ndarray | None = None
    predicted: np.ndarray | None = None


@dataclass(frozen=True)
class Course:
    """What the next `--online` goes on from, by name of parameter. first_mean, first_sd: the prior before any run, in
    the unit and in the coordinate. value, sd_z: what is known after the last one, in the unit and in the coordinate."""

    first_mean: Mapping[str, float]
    first_sd: Mapping[str, float]
    value: Mapping[str, float]
    sd_z: Mapping[str, float]


@dataclass(frozen=True)
class Update:
    """Online: the estimate after one more run, value and sd (n,) in units."""

    run: str
    value: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class Found:
    """The whole. n parameters, free ones first, then those fixed by hand; (n,) arrays may be of the free ones alone.

    covariance: of the coordinates z, (n, n), NaN rows where not identifiable; None where the method gives none.
    information: before the fit. train, test: rows of predictors (measures.judge) over the steps of `train_segments` and
    `test_segments`, OURS among them; test empty where nothing was held out. closed_loop_m: mean error of the free run
    with the controller in the loop. uncertainty: how sd came about, in words. natures: what runs are, by name, of those
    that say so. p_RS: attachment points (cable, 2, 3) [m]. sensing, command_delay [s]: of the robot's
    controller, None where nothing was measured.
    """

    request: Request
    robot: str
    engine: str
    step: float
    loss: str
    parameters: tuple[ParameterFound, ...]
    train_segments: tuple[SegmentFound, ...]
    train: Mapping[str, Row]
    cost: float
    residuals: int
    converged: bool
    reason: str
    rollouts: int
    test_segments: tuple[SegmentFound, ...] = ()
    test: Mapping[str, Row] | None = None
    floor: Floor | None = None
    free_runs: tuple[FreeRunFound, ...] = ()
    closed_loop_m: float | None = None
    repeats: Repeats | None = None
    covariance: np.ndarray | None = None
    information: Identifiability | None = None
    trace: tuple[TraceStep, ...] = ()
    starts: tuple[StartFound, ...] = ()
    profiles: tuple[ProfileFound, ...] = ()
    windows: tuple[WindowFound, ...] = ()
    updates: tuple[Update, ...] = ()
    course: Course | None = None
    p_RS: np.ndarray | None = None
    sensing: Sensing | None = None
    command_delay: float = 0.0
    mask: str | None = None
    uncertainty: str = ""
    natures: Mapping[str, str] = field(default_factory=dict)
    computed_by_torch: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """The row of `test` that is our prediction: with what repeats, where training intervals speak for it."""
        used = self.repeats is not None and self.repeats.used and REPEATS in (self.test or {})
        return REPEATS if used else OURS

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return tuple(one.free.name for one in self.parameters)

    @property
    def correlation(self) -> np.ndarray | None:
        """Correlation of the coordinates, (n, n)."""
        return None if self.covariance is None else correlation_of(self.covariance)

"""What `identify` says: printed as tables, and its `--json` document. SI; numbers of a parameter in its own unit."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.results import StageResult

Interval = tuple[float, float]
Trust = Literal["identified", "weak", "not identifiable", "on a bound", "fixed"]


class ParameterFigures(Frozen):
    """One parameter. None: the runs do not say it."""

    value: float
    """With which the errors were found. Where it is not identifiable nothing speaks for it; of an effect it is off."""
    sd: float | None
    lower: float | None
    upper: float | None
    """95 % interval."""
    range: Interval | None
    """Over starts and re-drawn noise; None: not studied, or the runs do not say the number."""
    unit: str
    identifiable: bool
    trust: Trust
    reason: str
    start: float
    bounds: tuple[float | None, float | None]
    what: str = ""


class Measures(Frozen):
    """The measures of the design over some segments. None: they do not exist for these."""

    keyframe_cap_rmse_m: float | None
    free_run_cap_mean_m: float | None = None
    free_run_closed_loop_cap_mean_m: float | None = None


class Intervals(Frozen):
    """95 % intervals of the same, by bootstrap over segments. None: fewer than two segments."""

    keyframe_cap_rmse_m: Interval | None = None
    free_run_cap_mean_m: Interval | None = None


class Baseline(Measures):
    """A simpler prediction of the same segments."""

    intervals: Intervals = Intervals()
    difference: Intervals = Intervals()
    """Ours minus this one, 95 %: below 0 we are better, over the segments that both predict."""
    ours_better: float | None = None
    """Share of the resamples of the segments in which ours is better at the key frames. No level of confidence: of few
    segments all resamples can agree where the interval of the difference, which counts how few they are, holds 0."""


class HeldOut(Measures):
    """What was not fitted: the test segments. With the controller in the loop it is the simulator alone."""

    predictor: str = "identified"
    """Whose errors these are: `identified`, the simulator with the numbers found; or `identified + what repeats`, with
    what it leaves behind and the robot repeats added, where training segments speak for it. The simulator alone is then
    among the baselines."""
    intervals: Intervals = Intervals()
    baselines: dict[str, Baseline] = Field(default_factory=dict)
    """`nothing moves`, `repeat the same phase`, `nominal`, `refit of two parameters`: by name."""
    floor_m: float | None = None
    """What remains when nothing is wrong; None: not known."""


class RepeatsFigures(Frozen):
    """What the simulator leaves behind in training segments and the robot repeats with the same two targets. No physics."""

    used: bool
    """Whether it is part of the prediction: training segments are predicted better with it."""
    gap_m: float
    """What the simulator is off at the key frames of training segments, beyond the floor."""
    floor_m: float
    """How far the robot repeats itself in training segments."""
    contrasts: int
    """Independent differences that the floor rests on."""
    weights: tuple[float, ...]
    """What the repeats count beside the simulator, 0 to 1, of each test segment; 0: its transition was never seen."""
    repeats: tuple[int, ...]
    """How many training segments repeat it."""
    left_out_alone_m: float | None
    """Key-frame error of training segments, the simulator alone; None: none of them has a repeat."""
    left_out_m: float | None
    """The same with the repeats of the others."""
    left_out: int
    """Segments that this rests on."""


class Direction(Frozen):
    """A combination of parameters that the runs hardly see, before any fit."""

    eigenvalue: float
    words: str


class Correlation(Frozen):
    """Two parameters that the runs can hardly tell apart."""

    one: str
    other: str
    value: float


class ProfileFigures(Frozen):
    """Profile likelihood of one parameter."""

    parameter: str
    lower: float | None
    upper: float | None
    """95 % interval; None: the cost does not rise far enough within the grid."""
    words: str = ""
    """How it differs from the interval of the covariance."""


class SegmentFigures(Frozen):
    """One target interval."""

    run: str
    interval: int
    """1-based."""
    role: Literal["train", "test", "not used"]
    keyframe_cap_rmse_m: float
    """Of the simulator alone."""
    cap_rmse_m: float
    """Over all frames."""
    predicted_cap_rmse_m: float | None = None
    """At the key frame, with what repeats; None: that is no part of the prediction, or it was trained on."""
    baselines: dict[str, float | None] = Field(default_factory=dict)
    """keyframe_cap_rmse_m of each."""
    not_white: tuple[int, ...] = ()
    """Caps whose residuals are correlated along the segment: something is not modelled, or the tracker drifted."""


class StartFigures(Frozen):
    """One fit from its own start or from re-drawn noise."""

    kind: Literal["start", "noise drawn anew"]
    cost: float
    iterations: int
    reason: str


class IdentifyReport(Frozen):
    """Everything that one `identify` found."""

    method: Literal["default", "paper", "cma"]
    drive: Literal["command replay", "closed loop"]
    loss: str
    """In words."""
    mask: str | None = None
    """Direction mask of the Key Frame Loss, in words; method paper only."""
    uncertainty: str = ""
    """How the standard deviations came about: misfit and correlated residuals counted or not."""
    effects: tuple[str, ...] = ()
    parameters: dict[str, ParameterFigures]
    train: Measures
    heldout: HeldOut | None
    """None: all segments were trained on."""
    repeating: RepeatsFigures | None = None
    """None: not asked for, or no training segment has a repeat."""
    segments: tuple[SegmentFigures, ...]
    weak: tuple[Direction, ...] = ()
    correlations: tuple[Correlation, ...] = ()
    """The strongest."""
    profiles: tuple[ProfileFigures, ...] = ()
    starts: tuple[StartFigures, ...] = ()
    cost: float
    residuals: int
    converged: bool
    reason: str
    rollouts: int
    """Simulations of one window, all starts together."""
    wall_s: float = 0.0
    """Set by the command: stages know no clock."""
    seconds: dict[str, float] = Field(default_factory=dict)
    """The same by part: fit, starts, ranges, profiles ..."""
    computed_by: Literal["machine code", "torch"] = "machine code"
    warnings: tuple[str, ...] = ()


class IdentifyResult(StageResult):
    """What `identify` prints: as every stage, and the numbers that others rely on at the top. None where it did not run."""

    schema_: Literal["r2s2r.identify/1"] = Field(default="r2s2r.identify/1", alias="schema")  # type: ignore[assignment]
    parameters: dict[str, ParameterFigures] | None = None
    train: Measures | None = None
    heldout: HeldOut | None = None
    """None also where all segments were trained on."""
    wall_s: float | None = None
    rollouts: int | None = None


class Recovered(Frozen):
    """One parameter over all cases of a self-test, relative to the planted value where its unit allows that."""

    unit: str
    bias: float
    """Mean of value - truth."""
    rmse: float
    sd_reported: float | None
    """Median of what the fits reported; None: never identifiable."""
    coverage: float | None
    """Share of the cases whose 95 % interval holds the truth; None: never identifiable."""
    identifiable: float
    """Share of the cases in which it was."""


class RecoveredCase(Frozen):
    """One planted robot."""

    truth: dict[str, float]
    value: dict[str, float]
    sd: dict[str, float | None]
    covered: dict[str, bool | None]
    converged: bool
    rollouts: int


class SelfTestReport(Frozen):
    """`identify --self-test`: known values planted in the user's own set-up, and what came back. Simulated by the engine itself."""

    cases: tuple[RecoveredCase, ...]
    parameters: dict[str, Recovered]
    noise_m: float
    """Of the planted observations, sd per axis, median over caps."""
    converged: float
    """Share of the cases."""
    seed: int
    warnings: tuple[str, ...] = ()


class SelfTestResult(Frozen):
    """What `identify --self-test` prints; no artifact is written."""

    schema_: Literal["r2s2r.identify.self_test/1"] = Field(default="r2s2r.identify.self_test/1", alias="schema")
    inputs: tuple[str, ...]
    wall_s: float
    report: SelfTestReport

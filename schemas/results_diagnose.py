"""What `diagnose` says: printed in words, and at the top of its `--json` document. SI."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.parity import ParityFound, rows
from schemas.results import StageResult

Verdict = Literal["effect", "pair", "ambiguous", "no_gap", "unknown"]


class ElementFound(Frozen):
    """A part of the robot, or where it stands."""

    kind: Literal["cable", "cap", "rod", "motor", "sensor", "place", "world", "camera"]
    index: int | None = None
    """None: all of the kind, or a kind without numbers."""
    xy_m: tuple[float, float] | None = None


class RankedName(Frozen):
    """One name of the ranking: an effect at its best element, `none` or `unknown`."""

    effect: str
    elpd_gain: float
    """Log predictive density over the refit nominal model on gaits that were left out, of which no piece says more than
    6 nats (12 before version 18) [nats]."""
    elpd_gain_sd: float | None = None
    """Its sd, from how much the left-out parts differ in it; None: one part, or no fit."""
    marginal_nats: float | None = None
    """Log ratio of marginal likelihoods over the refit nominal model, all gaits together, of which no piece says more
    than 6 nats (whatever it says before version 18) [nats]; None: before version 13."""
    parity_nats: float = 0.0
    """What the parity stage says for it, without a simulator [nats]."""
    fitted: bool = True
    """False: the screening left it out, and it counts as gaining nothing."""
    seen_sd: float | None = None
    """How far these gaits would show it, at the largest size that is tried, nuisances taken off: whitened length [sd];
    None: no replay shows it, or before version 14."""
    strain_nats: float | None = None
    """What it costs that its nuisances are not where healthy runs, or robot.toml, have them [nats]; None: it was not
    fitted, or before version 20."""
    probability: float
    size: dict[str, float] = Field(default_factory=dict)
    """Of its numbers, by name, in `units`."""
    ci90: dict[str, tuple[float, float]] = Field(default_factory=dict)
    units: dict[str, str] = Field(default_factory=dict)
    channel: str | None = None
    element: ElementFound | None = None
    rmse_m: float | None = None
    """Of the caps at the ends of intervals that were left out."""
    moved: bool = True
    """False: the fit never left its start, so that its size says nothing."""
    on_bound: tuple[str, ...] = ()


class WhereFound(Frozen):
    """Where the gap lies."""

    segments: tuple[str, ...]
    """Target intervals that stand out, RUN:N."""
    onset_segment: int | None
    """The gap begins with it, counted from 1 through all intervals of all runs; None: no beginning stands out."""
    onset: str | None = None
    """The same as RUN:N."""
    channel: str | None
    element: ElementFound | None


class PairFound(Frozen):
    """Two effects at once."""

    effects: tuple[str, ...]
    elpd_gain: float
    """Left-out log predictive density over the refit nominal model: what its first effect gains and what the second adds,
    12 nats a piece at most [nats]."""
    marginal_nats: float | None = None
    """The same of all data, where all that the second adds counts [nats]; since version 13 of `diagnose`."""


class ShrinkageFound(Frozen):
    """How far the gap shrinks on intervals that nothing was fitted to."""

    metric: Literal["keyframe_cap_rmse_m"] = "keyframe_cap_rmse_m"
    effects: tuple[str, ...]
    """Whose effect it is: what the verdict names, else the best one."""
    nominal: float | None
    refit: float | None
    refit_plus_effect: float | None
    ceiling: float | None
    """A black box that may correct anything it can predict."""
    floor: float
    own_share: float | None
    """Of the refit model's gap above the floor; None: that gap is at the floor."""
    ci90: tuple[float, float] | None
    predicted: float | None
    """The same before anything seen there was looked at: from the targets of the judged intervals, and errors of fitted
    ones by numbers fitted without their gait (until version 19 from these alone)."""
    judged_on: tuple[str, ...]
    set_aside: tuple[str, ...] = ()
    """Of them, those that do not count: the floor was measured without the worst intervals, too."""
    within_run: bool
    """Judged intervals share a run with fitted ones."""


INDISTINCT = 3.0
"""[nats] Two effects that runs tell apart by less than this cannot be told apart."""
IN_WORDS = {"none": "nothing wrong", "unknown": "something unnamed"}
"""Names of a ranking that are no effects, in a sentence."""
NO_REPLAY = ("camera_pose", "dropout")
"""Effects that change no prediction, only what is seen or missing: intervals begin where the camera saw the robot, so
that one which was moved is seen where it was. The parity stage sees both."""
LOGGED = ("sensor_bias", "sensor_gain")
"""Effects that logs show without a simulator: what a sensor says beside what the camera sees of its cable."""
LAWLESS = 0.875
"""How probable a cause without a name is where the logs show what no law of the catalogue has: six of six such
calibration sets had one (`calibration-3` to `-9`; Laplace's rule of succession)."""
BY_CHANCE = 4.0
"""[nats] That the parity stage says for the best of a whole catalogue where nothing is wrong: less than that says
nothing, and weighed like more it outdoes gains that are real."""


class NextGaitFound(Frozen):
    """What to run next."""

    name: str
    file: str | None
    """A policy file for `r2s2r record FILE`; None with --no-draw: it is written beside the pictures."""
    targets: tuple[tuple[float, ...], ...]
    nats: float
    """What it is worth: equally probable candidates would have to stand so far apart for the right one to become as
    much likelier as is expected after it."""
    now: float | None
    """The same of the gaits that were run, were the best of them run again."""
    candidates: tuple[str, ...] = ()
    """Names that it would tell apart, most probable first; `none`: nothing wrong."""
    narrows: int | None = None
    """Target intervals by which it narrows the bound that `no_gap` is judged by: no gait tells candidates apart, and
    this one is suggested for that."""


class SegmentFound(Frozen):
    """One fitted target interval, simulated from its own start by the refit nominal model."""

    run: str
    interval: int
    gait: str
    rmse_m: float
    """At its end, left out."""
    with_effect_m: float | None
    misfit: float
    """Squares over what noise and floor explain."""
    gap: bool
    t_s: tuple[float, float]


class DiagnoseReport(Frozen):
    """The whole of it."""

    verdict: Verdict
    sentence: str
    effects: tuple[str, ...]
    probability: float
    set90: tuple[str, ...]
    """Names that held the truth in nine of ten calibration sets, but none below one in fifty: effects that nothing speaks
    for are not among them."""
    ranking: tuple[RankedName, ...]
    pairs: tuple[PairFound, ...] = ()
    """The best effect with others beside it, best first."""
    where: WhereFound
    shrinkage: ShrinkageFound | None
    not_testable: tuple[str, ...]
    """Effects that these gaits would not show."""
    confusable: tuple[tuple[str, str, float], ...]
    """Pairs of effects and the nats by which these gaits tell them apart; below 3 they do not."""
    next_gait: NextGaitFound | None
    iteration: int | None = None
    """Of the project, whose simulator was diagnosed."""
    free_iteration: int | None = None
    """The first iteration after all that the project has."""
    robot: str
    floor_m: float
    floor_from: str
    floor_given: bool
    refit_rmse_m: float
    refit_upper_m: float | None
    """Upper 90 % bound; below 1.25 `refit_floor_m` there is no gap."""
    refit_floor_m: float | None = None
    """The floor of as large a share of the intervals; None: before version 17 of the stage, `floor_m`."""
    refit_kept: float = 1.0
    """Share of the intervals, the best ones, that these three are of."""
    chance_nats: float
    """What the best of the catalogue gains left out by chance in one case of twenty."""
    gap_nats: float | None = None
    """What today's pieces cost beyond as many of the healthy runs, under the refit nominal model."""
    left_nats: float | None = None
    """The same, each piece under the hypothesis that predicts it best: what no effect explains."""
    left_sd_nats: float | None = None
    """Sd of both, from how much pieces differ."""
    stranger_sd2: float | None = None
    """What any two laws of the catalogue leave of the offsets of the sensors, sum of squares over their errors; None:
    nothing that stands out."""
    calibrated: str
    left_out: str
    segments: tuple[SegmentFound, ...]
    hidden: tuple[str, ...]
    """What refitting had been hiding, in words."""
    parity: tuple[str, ...]
    """What the logs say against each other, strongest first, in words."""
    parity_sd: tuple[float, ...] = ()
    """How far each of these stands out [sd]; none before this was noted."""
    parity_effects: tuple[str, ...] = ()
    """The effect that each of these speaks for most, empty: for none; none before this was noted."""
    missing: tuple[str, ...]
    refit: dict[str, tuple[float, float]]
    """Nuisances of the refit nominal model: value and sd."""
    refit_units: dict[str, str] = Field(default_factory=dict)
    """`log`: the logarithm of a factor on the identified value."""
    rollouts: int
    within_run: bool
    wall_s: float = 0.0
    seconds: dict[str, float] = Field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def findings(self) -> tuple[ParityFound, ...]:
        """`parity` with its `parity_sd` and `parity_effects`."""
        return rows(self.parity, self.parity_sd, self.parity_effects)


class DiagnoseResult(StageResult):
    """What `diagnose` prints: as every stage, and what it found at the top. None where it did not run."""

    schema_: Literal["r2s2r.diagnose/1"] = Field(default="r2s2r.diagnose/1", alias="schema")  # type: ignore[assignment]
    verdict: Verdict | None = None
    effects: tuple[str, ...] | None = None
    probability: float | None = None
    set90: tuple[str, ...] | None = None
    ranking: tuple[RankedName, ...] | None = None
    where: WhereFound | None = None
    shrinkage: ShrinkageFound | None = None
    not_testable: tuple[str, ...] | None = None
    confusable: tuple[tuple[str, str, float], ...] | None = None
    next_gait: NextGaitFound | None = None

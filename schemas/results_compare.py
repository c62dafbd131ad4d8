"""What `compare` says: printed as tables, and put into its `--json` document. SI; None: not known, `floor` None: nothing
repeats in these runs."""

from __future__ import annotations

from pydantic import Field

from schemas.base import Frozen


class Durations(Frozen):
    """Of a run, over the target intervals that are compared [s]."""

    real: float
    sim: float


class CompareFloor(Frozen):
    """What a perfect simulator would be found to be wrong by, from repeats of the runs (key frames: else from
    floor.h5)."""

    com_end_m: float | None
    heading_end_rad: float | None
    segment_s: float | None
    keyframe_cap_m: float | None
    path_m: float | None = None
    cap_m: float | None = None
    gait_m: float | None = None


class CompareRepeatability(Frozen):
    """Repeats of one policy, laid on each other at the start; standard deviations of one run."""

    policy: str
    runs: tuple[str, ...]
    com_mean_m: tuple[float, float]
    """Where the centre of mass ended, along and across the heading at the start."""
    com_sd_m: tuple[float, float]
    turn_mean_rad: float | None
    turn_sd_rad: float | None
    duration_mean_s: float
    duration_sd_s: float


class CompareEnd(Frozen):
    """Where a run ended, from where it started, along and across its heading there; and how far it turned."""

    com_m: tuple[float, float]
    turn_rad: float | None


class CompareOpening(Frozen):
    """The rest shape in which a run opened, before the policy; the comparison begins at its end."""

    duration_s: float
    moved_m: float | None
    """How far the caps moved in it, up to a move over the ground, root mean square; None: not seen."""
    travel_m: float | None
    """How far the centre of mass came over the ground."""


class CompareRun(Frozen):
    """One run under one simulator, laid on each other where the policy begins."""

    run: str
    policy: str
    """With the iteration before it where the run is of an earlier one: `001-straight`."""
    iteration: int
    """In which it was run."""
    model: str
    trained_on: bool
    """The simulator's numbers were learned from this run: no claim of accuracy rests on it."""
    intervals: int
    """Target intervals that are compared."""
    of_intervals: int = 0
    """How many the real run has: fewer are compared where the robot was not seen to the end of one, or where the
    simulated controller went on to another target."""
    com_end_error_m: float | None
    heading_end_error_rad: float | None
    keyframe_cap_rmse_m: float | None
    """By command replay, each interval from its own start (docs/concepts/measures.md)."""
    cap_rmse_m: float | None
    """In closed loop, at equal shares of each target interval."""
    path_error_m: float | None
    """Of the centre of mass over the ground, the same way."""
    gait_m: float | None
    """Of the caps at the end of each target interval, both laid on each other at its start."""
    segment_s: float | None
    """Root mean square difference of the durations of the target intervals."""
    duration_s: Durations | None
    end: CompareEnd | None
    real_end: CompareEnd
    floor: CompareFloor
    repeatability: CompareRepeatability | None
    opening: CompareOpening | None = None
    """None: the run opened with the policy itself; its first frame is the start."""


class CompareMeasure(Frozen):
    """One measure over several runs: root mean square, its 95 % interval by bootstrap over runs (None: fewer than two),
    and what is left of it above the floor."""

    rms: float
    lower: float | None
    upper: float | None
    floor: float | None
    gap: float | None
    """sqrt(max(0, rms^2 - floor^2)); None without a floor."""
    change: float | None
    """rms less that of the first simulator, over the runs that both have; None for the first one."""
    change_lower: float | None
    change_upper: float | None
    """Its 95 % interval by bootstrap over runs (None: fewer than two)."""
    runs: int


class CompareModel(Frozen):
    """One simulator over the runs of the iteration, and over those that no simulator of the comparison was trained on."""

    model: str
    words: str
    """Where its numbers come from."""
    runs: dict[str, CompareMeasure]
    """By measure: com_end_m, heading_end_rad, keyframe_cap_m, cap_m, path_m, gait_m, segment_s."""
    heldout: dict[str, CompareMeasure]
    srcc_com: float | None
    """Spearman's rank correlation with the robot over the gaits of all iterations that are compared: of how far the
    centre of mass came. None: too few gaits."""
    srcc_turn: float | None
    """The same of how far the robot turned."""
    gaits: int


class ComparePolicy(Frozen):
    """One policy under one simulator, its repeats together: a column of the paper's Table II."""

    policy: str
    iteration: int
    model: str
    """Empty: the real robot."""
    trained_on: bool
    runs: int
    in_part: int = 0
    """Of these runs, those of which the last target intervals are not compared; their ends are of before."""
    com_m: tuple[float, float] | None
    """Mean end of the centre of mass, along and across the heading at the start."""
    turn_rad: float | None
    com_error_m: float | None
    """Root mean square over the runs; None for the real robot."""
    turn_error_rad: float | None


class CompareHistory(Frozen):
    """One simulator over the runs of one iteration, each beside the floor of that iteration's repeats."""

    iteration: int
    model: str
    trained_on: bool
    """It was trained on some of these runs."""
    runs: dict[str, CompareMeasure]


class CompareReport(Frozen):
    """All runs under all simulators."""

    iteration: int
    runs: tuple[CompareRun, ...]
    """Those of the iteration first, then those of earlier ones."""
    models: tuple[CompareModel, ...]
    policies: tuple[ComparePolicy, ...]
    history: tuple[CompareHistory, ...]
    """The same runs under better and better simulators: by iteration of the runs, then in the order of the simulators."""
    repeatability: tuple[CompareRepeatability, ...]
    floor: CompareFloor
    srcc: dict[str, float | None] = Field(default_factory=dict)
    """`srcc_com` by simulator; None: too few gaits."""
    stale: tuple[str, ...] = ()
    """What simulators were stale by when they were compared, in words. The terminal has it of their files, among the
    stale inputs of every stage; the page says nothing of inputs."""
    warnings: tuple[str, ...] = ()

"""What `compare` says: printed as tables, and put into its `--json` document. SI; None: not known, `floor` None: nothing
repeats in these runs."""

from __future__ import annotations

from schemas.base import Frozen


class Durations(Frozen):
    """Of a run, over the target intervals that are compared [s]."""

    real: float
    sim: float


class CompareFloor(Frozen):
    """What a perfect simulator would be found to be wrong by, from repeats of the runs (caps: from floor.h5)."""

    com_end_m: float | None
    heading_end_rad: float | None
    segment_s: float | None
    keyframe_cap_m: float | None


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


class CompareRun(Frozen):
    """One run under one simulator, laid on each other at the first frame."""

    run: str
    policy: str
    model: str
    trained_on: bool
    """The simulator's numbers were learned from this run: no claim of accuracy rests on it."""
    intervals: int
    """Target intervals that are compared."""
    com_end_error_m: float | None
    heading_end_error_rad: float | None
    keyframe_cap_rmse_m: float | None
    """By command replay, each interval from its own start (design.md, Measures)."""
    cap_rmse_m: float | None
    """In closed loop, at equal shares of each target interval."""
    path_error_m: float | None
    """Of the centre of mass over the ground, the same way."""
    segment_s: float | None
    """Root mean square difference of the durations of the target intervals."""
    duration_s: Durations | None
    end: CompareEnd | None
    real_end: CompareEnd
    floor: CompareFloor
    repeatability: CompareRepeatability | None


class CompareMeasure(Frozen):
    """One measure over several runs: root mean square, its 95 % interval by bootstrap over runs (None: fewer than two),
    and what is left of it above the floor."""

    rms: float
    lower: float | None
    upper: float | None
    floor: float | None
    gap: float | None
    """sqrt(max(0, rms^2 - floor^2)); None without a floor."""
    runs: int


class CompareModel(Frozen):
    """One simulator over all runs, and over those it was not trained on."""

    model: str
    words: str
    """Where its numbers come from."""
    runs: dict[str, CompareMeasure]
    """By measure: com_end_m, heading_end_rad, keyframe_cap_m, cap_m, path_m, segment_s."""
    heldout: dict[str, CompareMeasure]
    srcc_com: float | None
    """Spearman's rank correlation with the robot over gaits: of how far the centre of mass came."""
    srcc_turn: float | None
    """The same of how far the robot turned."""
    gaits: int


class CompareReport(Frozen):
    """All runs under all simulators."""

    runs: tuple[CompareRun, ...]
    models: tuple[CompareModel, ...]
    repeatability: tuple[CompareRepeatability, ...]
    floor: CompareFloor
    warnings: tuple[str, ...] = ()

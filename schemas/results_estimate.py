"""What `estimate` says about its runs: printed as a table, and put into its `--json` document. SI."""

from __future__ import annotations

from schemas.base import Frozen


class CapFigures(Frozen):
    """One end cap over one run."""

    cap: int
    noise_sd_m: tuple[float, float, float]
    """Assumed noise, per axis."""
    held: tuple[bool, bool, bool]
    """Axes that the source held; there the median noise of the run stands in."""
    sd_median_m: float
    """Median over frames of the smoothed position's standard deviation, root mean square over axes."""
    outliers: int
    jumps: int
    contact_share: float
    """Share of the frames in contact."""
    height_min_m: float
    """Lowest smoothed centre above the ground."""
    speed_median_m_per_s: float
    speed_max_m_per_s: float
    innovation_variance: float
    innovation_lag1: float
    white: bool


class RodFigures(Frozen):
    """One rod over one run."""

    rod: int
    length_m: float
    """Median distance of its caps as observed."""
    length_sd_m: float
    length_robot_m: float
    correction_max_m: float
    """Largest move of a smoothed cap that made the rod rigid."""


class GroundFigures(Frozen):
    """The ground of one run."""

    shift_m: float
    """Added to z."""
    shift_sd_m: float
    offset_recording_m: float
    """The simpler figure of `import`: cap radius minus mean height of the lowest cap, an upper estimate."""
    height_error_m: float | None
    """Usual height of the third lowest cap, which carries a robot at rest: what heights are worth. None: it does not stand on three."""
    slope: tuple[float, float] | None
    slope_sd: tuple[float, float] | None
    """None: the contacts do not spread widely enough."""
    contacts_mean: float
    """Mean number of caps in contact."""
    below_three_share: float
    """Share of frames with fewer than three contacts: moving dynamically, or heights too noisy to tell."""


class BrokenFrames(Frozen):
    """Frames at which the tracks jump or leave the others behind."""

    interval: int | None
    """Target interval, 1-based; None outside."""
    t_s: tuple[float, ...]
    caps: tuple[int, ...]


class EstimateRun(Frozen):
    """One run."""

    run: str
    frames: int
    """Kept frames."""
    rows: int
    """Rows of the recording."""
    duration_s: float
    intervals: int
    segments: int
    source_rigid: bool
    caps: tuple[CapFigures, ...]
    rods: tuple[RodFigures, ...]
    ground: GroundFigures
    broken: tuple[BrokenFrames, ...]
    sensors: int
    """Sensor lengths carried along."""
    warnings: tuple[str, ...] = ()


class EstimateReport(Frozen):
    """All runs of one estimate."""

    runs: tuple[EstimateRun, ...]

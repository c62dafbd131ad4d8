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


class CapSight(Frozen):
    """How one end cap was seen by the camera."""

    cap: int
    seen: float
    """Share of the frames in which it was seen and used."""
    rejected: int
    """Frames in which it was seen, and contradicted the rest."""
    hidden_longest_s: float
    """Longest time without a sighting."""
    residual_sd: float | None
    """Root mean square of `frames/score`: 1 where sightings are as noisy as they are taken for."""


class SensorFigures(Frozen):
    """One cable sensor against the camera."""

    cable: int
    bias_m: float
    """Shown minus seen, mean over the run."""
    bias_sd_m: float
    noise_sd_m: float | None
    dead: bool
    """Not used: it contradicts everything else, or never speaks."""


class CameraFigures(Frozen):
    """What only a run of camera images has."""

    height_m: float
    """Of the camera above the ground."""
    tilt_rad: float
    """Between its line of sight and the vertical."""
    plane_share: float | None
    """Share of the pixels with depth that lie on the ground."""
    depth_noise_sd_m: float | None
    """About the ground."""
    shift_px: tuple[float, float]
    """Depth beside colour; corrected."""
    noise_scale: tuple[float, float]
    begun_t_s: float
    searched: int
    """Frames in which the caps had been lost and were found again."""
    modes: dict[str, int]
    """Frames by what they had to do without."""
    sight: tuple[CapSight, ...]
    sensors: tuple[SensorFigures, ...]
    delay_s: float | None
    """By which the sensors' lengths come later than the pictures'; None: nothing moved enough to tell."""
    delay_sd_s: float | None
    settled: bool


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
    camera: CameraFigures | None = None
    """None: the recording brought the caps."""
    warnings: tuple[str, ...] = ()


class EstimateReport(Frozen):
    """All runs of one estimate."""

    runs: tuple[EstimateRun, ...]

"""What `import` says about one run: printed as a table, and put into its `--json` document."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen

LengthUnit = Literal["m", "dm", "cm", "mm"]
ImportFormat = Literal["trajectory_csv", "authors_folder", "tum_rgbd"]


class DroppedFrames(Frozen):
    """Rows left out of everything later, by reason. They stay in the recording, marked."""

    duplicate: int = 0
    """Less than 20 ms after the last kept frame."""
    backwards: int = 0
    """Stamp before the last kept frame."""
    not_observed: int = 0
    """An end-cap coordinate or the stamp is not finite."""

    @property
    def total(self) -> int:
        """All of them."""
        return self.duplicate + self.backwards + self.not_observed


class TimeGap(Frozen):
    """A hole between two kept frames."""

    after_s: float
    """Time of the frame before the hole."""
    length_s: float


class CapNoise(Frozen):
    """Noise of the end caps per axis, from residuals of 5-frame local lines."""

    sd_m: tuple[tuple[float, float, float], ...]
    """Per cap: x, y, z."""
    low_m: float
    """Smallest over caps and axes, held coordinates left out."""
    median_m: float
    high_m: float
    held: tuple[str, ...] = ()
    """Coordinates so quiet that the source must have held them (`cap5 z`: a tracker's ground constraint)."""


class ImportReport(Frozen):
    """One imported run. SI."""

    run: str
    format: ImportFormat
    robot: str
    nature: str
    source: str
    unit: LengthUnit = "m"
    """Length unit of the source's columns; the recording is in metres."""
    rows: int
    kept: int
    dropped: DroppedFrames
    duration_s: float
    """First to last kept frame."""
    frame_gap_median_s: float | None = None
    stamp_jitter_s: float | None = None
    gaps: tuple[TimeGap, ...] = ()
    """The longest holes, at most ten."""
    intervals: int
    intervals_complete: int
    segments: int
    noise: CapNoise | None = None
    noise_sd_stated_m: float | None = None
    rod_length_m: tuple[float, ...] = ()
    rod_length_sd_m: tuple[float, ...] = ()
    rod_length_robot_m: tuple[float, ...] = ()
    ground_offset_m: float | None = None
    streams: dict[str, int] = Field(default_factory=dict)
    """Samples a stream (`caps`, `commands`, `camera/color` ...)."""
    missing: dict[str, int] = Field(default_factory=dict)
    """What the source should have and has not, counted (`color`, `depth`, `data`, `motor`, `capacitance` ...)."""
    warnings: tuple[str, ...] = ()


class ImportReports(Frozen):
    """All runs of one import."""

    runs: tuple[ImportReport, ...]

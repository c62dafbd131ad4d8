"""What `calibrate` says: printed as tables, and put into its `--json` document. None stands where there is no number."""

from __future__ import annotations

from pydantic import Field

from schemas.base import Frozen
from schemas.robot import Lump


class SensorLine(Frozen):
    """The line of one sensor in one set: capacitance [F] = slope length [m] + offset."""

    sensor: int
    name: str
    points: int
    slope_f_per_m: float
    slope_se_f_per_m: float
    offset_f: float
    rms_m: float | None
    """Residual rms in length, of the lengths that the line reads back. None: dead."""
    worst_m: float | None
    loo_rms_m: float | None
    """The same from lines that did not see the point: what a new point would miss by."""
    quadratic_rms_m: float | None
    """What a parabola would leave; far below rms_m, the sensor is curved (advice only)."""
    state: str
    """`good`, or what is wrong."""


class SensorSet(Frozen):
    """One calibration of all sensors."""

    name: str
    rms_m: float | None
    """Over all points of the live sensors."""
    loo_rms_m: float | None
    dead: tuple[int, ...]
    falling: tuple[int, ...]
    lines: tuple[SensorLine, ...]


class FailedFit(Frozen):
    """A line of the history that cannot be used."""

    file: str
    date: str
    sensor: int
    slope_f_per_m: float
    state: str


class Swap(Frozen):
    """A recalibration that moved a length too far for a drift."""

    file: str
    before: str
    """Date of the earlier line."""
    after: str
    sensor: int
    change_m: float


class DriftSpread(Frozen):
    """Size of what recalibrations changed, lines that were only copied left out."""

    changes: int
    swaps: int
    """Of these."""
    median_m: float | None
    """Per recalibration."""
    p90_m: float | None
    median_m_per_day: float | None
    median_days: float | None
    """Time from one calibration to the next."""


class HistoryReport(Frozen):
    """What the dated sets say about drift."""

    entries: int
    first: str
    last: str
    range_from: str
    """Where the working range of the sensors, over which lines are compared, was taken from."""
    failed: tuple[FailedFit, ...]
    carried_over: int
    """Lines that were copied from the entry before: not a measurement."""
    swaps: tuple[Swap, ...]
    overall: DriftSpread
    without_swaps: DriftSpread
    short: DriftSpread
    """Recalibrations within two days."""
    per_sensor: tuple[DriftSpread, ...]


class TendonCurve(Frozen):
    """Force [N] = k1 x + k2 x^2 + k3 x^3 of one tendon."""

    name: str
    points: int
    k1_n_per_m: float
    k2_n_per_m2: float
    k3_n_per_m3: float
    rms_n: float
    x_max_m: float
    stiffness_min_n_per_m: float
    monotone: bool


class TendonReport(Frozen):
    """The curves and their average."""

    curves: tuple[TendonCurve, ...]
    k1_n_per_m: float
    k2_n_per_m2: float
    k3_n_per_m3: float
    k1_sd_n_per_m: float | None
    k2_sd_n_per_m2: float | None
    k3_sd_n_per_m3: float | None
    x_common_m: float
    """End of the range that every curve covers."""
    force_sd_n: float | None
    """Standard deviation between the curves there."""
    stiffness_min_n_per_m: float
    monotone: bool
    falls_from_m: float | None
    """Stretch from which the average would fall if it were used beyond its range; None: never."""


class RodMass(Frozen):
    """What the weighed parts make of one rod."""

    rod: str
    parts: int
    mass_kg: float
    com_m: float
    """Along the rod from the middle between its caps, positive towards the odd cap."""
    inertia_axial_kg_m2: float
    inertia_transverse_kg_m2: float
    """Both about the centre of mass."""


class SensorChange(Frozen):
    """New numbers of one sensor in robot.toml."""

    slope_f_per_m: float
    offset_f: float
    source: str
    """The comment that goes with them."""


class TendonChange(Frozen):
    """New numbers of the passive cables in robot.toml."""

    k1_n_per_m: float
    k2_n_per_m2: float
    k3_n_per_m3: float
    source: str


class PartsChange(Frozen):
    """New parts of one rod in robot.toml."""

    parts: tuple[Lump, ...]
    source: str


class RobotChanges(Frozen):
    """What this calibration changes in robot.toml."""

    sensors: dict[int, SensorChange] = Field(default_factory=dict)
    tendon: TendonChange | None = None
    rods: dict[str, PartsChange] = Field(default_factory=dict)

    @property
    def empty(self) -> bool:
        """Whether robot.toml stays as it is."""
        return not self.sensors and self.tendon is None and not self.rods


class CalibrationReport(Frozen):
    """Everything that was measured, and what it changes in robot.toml."""

    sets: tuple[SensorSet, ...] = ()
    used: str | None = None
    """Set whose lines go into robot.toml."""
    history: HistoryReport | None = None
    tendons: TendonReport | None = None
    masses: tuple[RodMass, ...] = ()
    changes: RobotChanges = RobotChanges()
    warnings: tuple[str, ...] = ()
    """One sentence each."""

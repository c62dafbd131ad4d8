"""What `bench estimate` prints with --json. SI, but where the name says otherwise."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen


class TrackScore(Frozen):
    """Estimated against true states of one run, or of several runs together. Errors of end caps are distances."""

    runs: int
    failed: int
    """Runs that could not be tracked. `within`, `covered` and `lost` count their frames, the other figures cannot."""
    frames: int
    """Of the runs that were tracked."""
    cap_mean_mm: float
    cap_p95_mm: float
    cap_max_mm: float
    rod_mean_mm: float
    """Of the rods' middles."""
    axis_mean_deg: float
    axis_p95_deg: float
    """Angle between estimated and true axis of a rod."""
    within: float
    """Share of rods and frames within 2 cm and 5 degrees."""
    com_mean_mm: float
    """Of the centre of mass."""
    covered: float
    """Share of caps and frames whose error lies inside the 95 % ellipsoid of the estimate."""
    lost: float
    """Share of frames in which some cap is more than 5 cm off."""
    contact_f1: float | None
    """Contact flags against normal forces above 5 % of the weight; caps that are within 1 mm of the ground and carry less
    are left out. None: no such contact."""
    delay_error_ms: float | None
    """Sensors against pictures: estimated minus true delay; of several runs the largest size. None: not known."""
    delay_unknown: int
    """Runs with sensors whose delay the estimate says it does not know."""
    floor_mm: float
    """Estimated minus true distance of the camera from the floor; of several runs the largest size."""
    floor_deg: float
    """Tilt of the estimated against the true floor, likewise the largest."""
    sensor_error_mm: float | None
    """Mean size of a sensor's mean error once its estimated bias is taken off. None: no sensors."""
    recovery_s: float | None
    """Time from the end of blindness until no cap is more than 2 cm off any more. None: never blind."""
    frames_per_s: float
    """By the clock on the wall: of a machine that does other things as well, less."""
    cpu_ms: float
    """Processor time a frame, all threads together, reading and decoding included."""
    memory_mb: float
    """By which the process grew while it tracked."""


class TrackedCase(Frozen):
    """One run."""

    seed: int
    score: TrackScore | None
    failed: str = ""
    """Why there is none."""


class EstimateBenchCase(Frozen):
    """The runs of one setting."""

    setting: dict[str, float | bool | str]
    all_: TrackScore | None = Field(alias="all")
    """Of all runs; None: all failed."""
    runs: tuple[TrackedCase, ...]


class EstimateBenchResult(Frozen):
    """The tracker on runs of the rig."""

    schema_: Literal["r2s2r.bench.estimate/1"] = Field(default="r2s2r.bench.estimate/1", alias="schema")
    machine: str
    versions: dict[str, str]
    robot: str
    run_s: float
    seeds: tuple[int, ...]
    cases: dict[str, EstimateBenchCase]

"""What `floor` says: printed as tables, put into its `--json` document and into floor.h5. SI."""

from __future__ import annotations

from schemas.base import Frozen


class CapFloor(Frozen):
    """From repeats of one phase, as the tracker sees them."""

    floor_m: float
    lower_m: float | None = None
    upper_m: float | None = None
    level: float | None = None
    sensor_m: float
    repeatability_m: float
    contrasts: int
    phases: int
    repeats: int
    """Target intervals that were compared."""
    basis: str


class CableFloor(Frozen):
    """One cable sensor at the end of target intervals."""

    sensor: int
    cable: int
    sd_m: float | None = None
    noise_m: float | None = None


class LengthFloor(Frozen):
    """Cable lengths, from the sensors alone: also where no end cap was observed."""

    floor_m: float
    contrasts: int
    phases: int
    basis: str
    within_m: float | None = None
    """The same with each iteration about its own means; None: of one iteration."""
    cables: tuple[CableFloor, ...]


class NumericsFloor(Frozen):
    """Engine against the rig's model, all effects off."""

    floor_m: float
    median_m: float
    worst_m: float
    moved_m: float
    gaits: int


class FloorReport(Frozen):
    """The floor of a project."""

    runs: tuple[str, ...]
    """Runs that were looked at, with their iteration: 1:crawl."""
    used: tuple[str, ...] = ()
    """Those of them that had something to compare."""
    given_up: int = 0
    """Target intervals left out, since their target was given up."""
    caps: CapFloor | None = None
    lengths: LengthFloor | None = None
    numerics: NumericsFloor | None = None
    warnings: tuple[str, ...] = ()

"""The sidecar of a foreign log: `crawl.toml` beside `crawl.csv`, `run1.toml` beside the folder `run1/`.

It says what the numbers cannot: which robot, who measured it, with which controller. Nothing of it is guessed.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from schemas.base import Frozen
from schemas.typed import Length, NonNegative, Positive, Radius, Share, Size, Tolerance

Nature = Literal["measured", "simulated", "kinematic sample"]


class SidecarPid(Frozen):
    """Controller and motors of the run, as far as they are known."""

    min_length_m: Length | None = None
    """Cable length at position 0."""
    range_m: Length | None = None
    """Length between position 0 and 1."""
    tolerance: Tolerance | None = None
    """Position error at which a cable is done."""
    p: NonNegative | None = None
    i: NonNegative | None = None
    d: NonNegative | None = None
    motor_speed: Share | None = None
    """Fraction of the no-load speed at control 1."""
    winch_radius_m: Radius | None = None


class Sidecar(Frozen):
    """What the source says about one run."""

    robot: Annotated[str, Field(min_length=1, max_length=200)]
    """Name of the robot description (`threebar`)."""
    source: Annotated[str, Field(min_length=1, max_length=2000)]
    """In words: robot, date, gait, who published it."""
    nature: Nature | None = None
    """What kind of truth the numbers are; stored as "not stated" where the key is absent."""
    frame: Annotated[str, Field(max_length=2000)] = ""
    """Coordinate frame in words. The numbers must be in a world frame with z up whatever it says."""
    noise_sd_m: Size | None = None
    """Noise per axis as the source states it; the import estimates its own beside it."""
    start_unix_s: Positive | None = None
    """Wall clock of the first row."""
    pid: SidecarPid = SidecarPid()

    @field_validator("source")
    @classmethod
    def _true(cls, source: str) -> str:
        if source.strip() == PLACEHOLDER:
            raise ValueError("the true source: the text of the example says nothing about these data")
        return source


PLACEHOLDER = "who measured what, and when"
"""Source of the minimal sidecar. It says nothing, so a sidecar that still has it is refused."""

MINIMAL_SIDECAR = f"""\
robot = "threebar"
source = "{PLACEHOLDER}"
nature = "measured"   # or "simulated", "kinematic sample"
"""
"""What `import` shows to a user whose log has no sidecar; refused until its source is a true one."""

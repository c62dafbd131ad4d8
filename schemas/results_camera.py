"""What `doctor camera` prints with `--json`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.robot import HsvRange


class CameraGround(Frozen):
    """The largest plane that the camera sees."""

    distance_m: float
    """From the camera, along the normal: its height over the ground."""
    tilt_rad: float
    """Between the optical axis and the normal: 0 where the camera looks straight down."""
    normal_C: tuple[float, float, float]
    """Towards the camera, in its frame."""
    inlier_share: float
    """Of the pixels with a depth."""
    noise_sd_m: float
    """Of single pixels about the plane, at the distances at which they were."""


class CameraRod(Frozen):
    """How a rod's caps are seen."""

    rod: str
    range: HsvRange | None
    """From robot.toml, or as measured where boxes or clicks were given."""
    measured: bool
    pixels: int
    """In this range and over the ground, in the median frame."""
    patches: int
    """Connected ones of 8 pixels and more: two where both caps are seen whole."""
    with_depth: float
    """Share of the pixels that have a depth."""
    distractors: int
    """Pixels of this range that lie on the ground."""


class CameraResult(Frozen):
    """A camera as it is seen through some of its frames."""

    schema_: Literal["r2s2r.camera/1"] = Field(default="r2s2r.camera/1", alias="schema")
    name: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    """[px], pixel centres at u + 0.5, v + 0.5."""
    distortion: tuple[float, ...]
    depth_scale_m: float
    """Metres a count."""
    frames: int
    lost: int
    repeated: int
    """Frames equal to the one before, to the last bit of depth."""
    rate_hz: float
    """Measured by the camera's clock."""
    rate_stated_hz: float
    clock_offset_s: float
    """Host's clock minus the camera's, for the frame that came soonest: what an unknown origin and the latency make."""
    clock_spread_s: float
    """Longest delay of a frame minus the shortest."""
    depth_unknown: float
    """Share of the pixels without a depth."""
    ground: CameraGround | None
    rods: tuple[CameraRod, ...]
    saved: str | None = None
    """The robot.toml that was changed."""
    preview: str | None = None

"""The table `[camera]` of a world file: where the rig's camera is, how badly it sees, what goes wrong with it. SI."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from schemas.base import Frozen
from schemas.typed import Coordinate, Duration, Fraction, NonNegative, Number, Positive, Radius, Share, Wait

Point = tuple[Coordinate, Coordinate, Coordinate]
Rgb = tuple[
    Annotated[int, Field(strict=True, ge=0, le=255)],
    Annotated[int, Field(strict=True, ge=0, le=255)],
    Annotated[int, Field(strict=True, ge=0, le=255)],
]
Pixels = Annotated[int, Field(strict=True, ge=16, le=4096)]


class DepthNoise(Frozen):
    """What is wrong with depth. Defaults: structured-light and stereo cameras (see docs/concepts/rig-camera.md)."""

    sd_per_m: NonNegative = 0.0012
    """Standard deviation = sd_per_m z^2 [m]; 0.00113 .. 0.0015 on real frames."""
    correlated_share: Fraction = 0.5
    """Part of the variance that neighbours share."""
    correlation_px: Annotated[float, Field(strict=True, ge=1, le=40)] = 6.0
    """Length over which they share it (1/e)."""
    lateral_px: NonNegative = 0.5
    """Every pixel looks past itself by so much, standard deviation; it frays edges."""
    disparity_step_px: NonNegative = 0.03125
    """Disparity is rounded to this, 0: not. 1/32 in stereo cameras of today, 1/8 in the first Kinect."""
    baseline_m: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.05
    """Between the two eyes; the step in depth is z^2 step / (fx baseline)."""
    flying_share: Fraction = 0.5
    """Part of the pixels on a depth edge that report something between front and back."""
    edge_hole_share: Fraction = 0.25
    """Part of the pixels on a depth edge that report nothing."""
    hole_share: Annotated[float, Field(strict=True, ge=0, le=0.9)] = 0.05
    """Part of all pixels that report nothing, in blobs. Real frames: 0.11 .. 0.34, furniture and windows included."""
    hole_px: Annotated[float, Field(strict=True, ge=1, le=40)] = 3.0
    """Size of these blobs."""
    misregistration_px: tuple[Number, Number] = (1.0, -0.5)
    """Depth lies this far (u, v) beside colour: an imperfect calibration between both."""
    smear: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.0
    """Weight of the last picture in this one: the driver's temporal filter, which drags what moves."""


class ColorNoise(Frozen):
    """What is wrong with colour."""

    sd: Annotated[float, Field(strict=True, ge=0, le=40)] = 3.0
    """Standard deviation per channel, in counts of 0 .. 255."""
    exposure_s: Duration = 0.008
    """What moves in this time is blurred."""
    exposure_drift: Annotated[float, Field(strict=True, ge=0, le=0.5)] = 0.06
    """The picture gets darker by up to this share and back."""
    exposure_period_s: Wait = 20.0
    """How long that takes."""


class Clock(Frozen):
    """The camera's own clock, and what happens between the exposure and the host."""

    rate_hz: Annotated[float, Field(strict=True, gt=0, le=240)] = 30.0
    """Frames a second, by its own clock."""
    origin_s: Number = 5000.0
    """What it shows when the rig starts."""
    drift_ppm: Annotated[float, Field(strict=True, ge=-1000, le=1000)] = 40.0
    """How much too fast it runs."""
    jitter_s: Duration = 0.0003
    """Standard deviation of the instant of exposure; the stamp tells it."""
    stamp_delay_s: Annotated[float, Field(strict=True, ge=-1, le=1)] = 0.0
    """The stamp is later than the middle of the exposure by this; the host cannot know."""
    latency_s: Duration = 0.03
    """From the exposure to the wire."""
    lost_share: Fraction = 0.002
    """Part of the frames that never leave the camera."""


class Faults(Frozen):
    """Scheduled failures; rig time. None: never."""

    gone_at_s: NonNegative | None = None
    """The camera is unplugged: the connection ends, and none is taken any more."""
    frozen_from_s: NonNegative | None = None
    """From here the same picture comes again and again, with new stamps and numbers."""
    frozen_until_s: NonNegative | None = None
    """To here; None: for ever."""
    stalled_from_s: NonNegative | None = None
    """From here nothing comes, and the connection stays."""
    stalled_until_s: NonNegative | None = None
    """To here; None: for ever."""
    clock_jump_at_s: NonNegative | None = None
    """When the camera's clock jumps."""
    clock_jump_s: Number = 0.0
    """And how far."""


class Occluder(Frozen):
    """Something between camera and robot: a capsule (an arm, a cable) or, with both ends equal, a ball."""

    a_m: Point
    """One end, frame W."""
    b_m: Point
    """The other."""
    radius_m: Radius
    """Round both and between them."""
    rgb: Rgb = (205, 160, 130)
    """Colour in full light."""
    v_m_per_s: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """It moves from a_m, b_m as of `from_s`."""
    from_s: NonNegative = 0.0
    """Rig time at which it comes."""
    until_s: NonNegative | None = None
    """And goes; None: it stays."""


class Distractor(Frozen):
    """A coloured disc that lies on the floor and is no robot."""

    center_m: tuple[Coordinate, Coordinate]
    """On the floor, x and y of frame W."""
    radius_m: Radius
    """Of the disc."""
    rgb: Rgb
    """Its colour."""


class CameraSettings(Frozen):
    """The rig's camera. Frame C: x right, y down, z forward."""

    width: Pixels = 640
    """Of both pictures [px]."""
    height: Pixels = 480
    """The same."""
    fx: Positive = 607.7
    """Focal length along u [px], as the camera states it; it is so but for `focal_error`."""
    fy: Positive = 607.7
    """Along v."""
    cx: Positive = 320.0
    """Principal point [px], pixel centres at u + 0.5."""
    cy: Positive = 240.0
    """The same, v + 0.5."""
    focal_error: Annotated[float, Field(strict=True, gt=-0.5, lt=0.5)] = 0.0
    """Its true focal lengths are (1 + focal_error) of the stated ones."""
    depth_scale: Annotated[float, Field(strict=True, ge=1e-5, le=1e-2)] = 0.00025
    """Metres a count; 1/4000 (L515), 1/1000 (D400)."""
    depth_error: Annotated[float, Field(strict=True, gt=-0.5, lt=0.5)] = 0.0
    """Its depths are (1 + depth_error) of the true ones."""
    position_m: Point = (0.0, 0.0, 1.44)
    """Of its optical centre, frame W."""
    look_at_m: Point = (0.0, 0.0, 0.0)
    """In the middle of the picture if the principal point is."""
    picture_up: tuple[Number, Number, Number] = (0.0, 1.0, 0.0)
    """Direction in the world that points up in the picture, as far as it can."""
    shift_m: Point = (0.0, 0.0, 0.0)
    """The camera is knocked at `knocked_at_s`: moved by this in the world, and stays there."""
    turn_rad: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """And turned by this rotation vector, in its own axes."""
    knocked_at_s: NonNegative = 0.0
    """Rig time of the knock."""
    floor_rgb: Rgb = (122, 118, 112)
    """Mean colour of the floor."""
    floor_texture: Annotated[float, Field(strict=True, ge=0, le=60)] = 10.0
    """Standard deviation of the floor's pattern, in counts."""
    floor_normal: tuple[Number, Number, Number] = (0.0, 0.0, 1.0)
    """Of the floor as it is seen, in W; the floor that is walked on has its own slope (effect `ground_slope`)."""
    floor_offset_m: Coordinate = 0.0
    """The floor as it is seen: normal . p = offset."""
    cap_value: Share = 0.85
    """Brightness of the coloured caps in full light."""
    depth: DepthNoise = DepthNoise()
    color: ColorNoise = ColorNoise()
    clock: Clock = Clock()
    faults: Faults = Faults()
    occluders: tuple[Occluder, ...] = ()
    """`[[camera.occluders]]`: arms, cables and balls between camera and robot."""
    distractors: tuple[Distractor, ...] = ()
    """`[[camera.distractors]]`: coloured discs on the floor."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        sight = [b - a for a, b in zip(self.position_m, self.look_at_m, strict=True)]
        if sum(x * x for x in sight) < 1e-6:
            raise ValueError("camera: position_m and look_at_m are one point")
        up = self.picture_up
        across = (
            sight[1] * up[2] - sight[2] * up[1],
            sight[2] * up[0] - sight[0] * up[2],
            sight[0] * up[1] - sight[1] * up[0],
        )
        if sum(x * x for x in across) < 1e-9:
            raise ValueError("camera: picture_up lies along the line of sight")
        if sum(x * x for x in self.floor_normal) < 1e-9:
            raise ValueError("camera: floor_normal is no direction")
        return self

    def ideal(self) -> CameraSettings:
        """The same camera without noise, loss, latency or faults."""
        depth = DepthNoise(
            sd_per_m=0, lateral_px=0, disparity_step_px=0, flying_share=0, edge_hole_share=0, hole_share=0,
            misregistration_px=(0, 0),
        )  # fmt: skip
        clock = Clock(rate_hz=self.clock.rate_hz, origin_s=0, drift_ppm=0, jitter_s=0, latency_s=0, lost_share=0)
        color = ColorNoise(sd=0, exposure_s=0, exposure_drift=0)
        return self.model_copy(update={"depth": depth, "color": color, "clock": clock, "faults": Faults()})

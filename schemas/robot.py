"""The robot description: what `robot.toml` holds. SI; suffixes name the unit where a person types a number.

The engine and the rig both build their model from this file and share nothing else.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base import Frozen
from schemas.typed import (
    Capacitance,
    CapacitanceSlope,
    Coordinate,
    Damping,
    Flag,
    Fraction,
    Frequency,
    Friction,
    Gain,
    Length,
    Mass,
    Name,
    Radius,
    Share,
    Size,
    Stiffness,
    Stiffness2,
    Stiffness3,
    TendonStiffness,
    Tolerance,
    Turning,
    Wait,
    Whole,
)

Vector3 = tuple[Coordinate, Coordinate, Coordinate]
Index = Annotated[int, Field(strict=True, ge=0)]
Hue = Annotated[float, Field(strict=True, ge=0, le=180)]
Channel = Annotated[float, Field(strict=True, ge=0, le=255)]


class Lump(Frozen):
    """A part of a rod, counted as a solid of its own around the rod's axis."""

    name: Name
    mass_kg: Mass
    offset_m: Coordinate
    """Centre along the rod from the middle between the caps; positive towards the odd cap."""
    shape: Literal["point", "sphere", "cylinder", "tube"]
    radius_m: Size = 0.0
    length_m: Size = 0.0
    inner_radius_m: Size = 0.0


class Rod(Frozen):
    """A rigid rod with two spherical end caps, numbered 2 i (offset -length/2) and 2 i + 1 (+length/2)."""

    name: Name
    length_m: Length
    """Cap centre to cap centre."""
    radius_m: Radius
    cap_radius_m: Radius
    parts: tuple[Lump, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if max(self.radius_m, self.cap_radius_m) >= self.length_m / 2:
            raise ValueError(
                f"rod {self.name}: radius_m and cap_radius_m must be below half of length_m ({self.length_m / 2:g} m), "
                "else its two caps overlap"
            )
        return self


class Cable(Frozen):
    """A cable between two end caps. Index = position in the list."""

    caps: tuple[Whole, Whole]
    kind: Literal["actuated", "passive"]
    stiffness_n_per_m: Stiffness
    damping_n_s_per_m: Damping
    stiffness2_n_per_m2: Stiffness2 = 0.0
    stiffness3_n_per_m3: Stiffness3 = 0.0
    """Force [N] = stiffness x + stiffness2 x^2 + stiffness3 x^3, x the stretch beyond the rest length [m]."""
    rest_length_m: Length | None = None
    """Passive cables only: an actuated cable's rest length is set by its winch."""
    sites_m: tuple[Vector3, Vector3]
    """Attachment points in the rod frame R of each cap's rod (origin in the middle, z towards the odd cap)."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.caps[0] // 2 == self.caps[1] // 2:
            raise ValueError(f"a cable must join two rods, caps {self.caps} lie on one")
        if (self.kind == "passive") != (self.rest_length_m is not None):
            raise ValueError("rest_length_m belongs to passive cables, and to them only")
        return self


class Motor(Frozen):
    """The winch of one actuated cable."""

    cable: Index
    no_load_rad_per_s: Turning
    speed: Share
    """Fraction of the no-load speed at full command (the paper's motor speed)."""
    winch_radius_m: Radius
    board: str = ""
    sign: Literal[-1, 1] = 1
    """Sign of the wire command that reels in."""


class Sensor(Frozen):
    """A capacitive stretch sensor: capacitance [F] = slope length + offset."""

    cable: Index
    slope_f_per_m: CapacitanceSlope | None = None
    offset_f: Capacitance | None = None
    """None: not calibrated."""
    stiffness_n_per_m: TendonStiffness = 0.0
    """Of the sensor tendon that runs parallel to an actuated cable; 0 where the cable itself is the sensor."""
    rest_length_m: Length | None = None
    """Below it the sensor tendon is slack; needed where its stiffness is above 0."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stiffness_n_per_m > 0 and self.rest_length_m is None:
            raise ValueError("a sensor tendon with a stiffness needs rest_length_m")
        return self


class Pid(Frozen):
    """The low-level controller: position = (length - min_length) / range, latched `done` within the tolerance."""

    p: Gain
    i: Gain
    d: Gain
    tolerance: Tolerance
    min_length_m: Length
    range_m: Length
    rate_hz: Frequency
    step_timeout_s: Wait

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.rate_hz * self.step_timeout_s < 1.0 - 1e-9:
            period = f": {self.rate_hz:g} looks like the period in seconds" if self.rate_hz < 1.0 else ""
            raise ValueError(
                f"rate_hz ({self.rate_hz:g} Hz) must have a tick within step_timeout_s ({self.step_timeout_s:g} s), else "
                f"every step is given up before the controller has acted once{period}"
            )
        return self


class Limits(Frozen):
    """What a healthy robot never leaves; `validate` and the host's safety checks use it."""

    cable_length_min_m: Length
    cable_length_max_m: Length
    cap_height_max_m: Length


class Contact(Frozen):
    """Prior of the ground contact, before identification."""

    friction: Friction
    restitution: Fraction


class HsvRange(Frozen):
    """Colour range of one rod; hue 0..180 as in 8-bit OpenCV, low > high wraps round red."""

    rod: str
    hue: tuple[Hue, Hue]
    saturation_min: Channel
    value_min: Channel


class Robot(Frozen):
    """A cable-driven robot of rigid rods and cables. Any number of both."""

    schema_version: Literal[1]
    name: Name
    title: str
    illustrative: Flag = False
    """True: a made-up robot, not one that was measured."""
    attachment: Literal["surface", "rod_end"]
    rods: tuple[Rod, ...] = Field(min_length=1)
    cables: tuple[Cable, ...] = Field(min_length=1)
    motors: tuple[Motor, ...]
    sensors: tuple[Sensor, ...] = ()
    pid: Pid
    limits: Limits
    contact: Contact
    colors: tuple[HsvRange, ...] = ()
    rest_caps_m: tuple[Vector3, ...]
    """End-cap centres in the rest state, all actuated cables extended, on the ground; frame W.

    The frames R in which `sites_m` are given are those of this pose: x is the direction perpendicular to the rod that
    points most upwards, z points to the odd cap (docs/concepts/attachment.md)."""

    @property
    def n_caps(self) -> int:
        """Number of end caps, two a rod."""
        return 2 * len(self.rods)

    @property
    def actuated(self) -> tuple[int, ...]:
        """Indices of the actuated cables; targets and commands have this order."""
        return tuple(i for i, cable in enumerate(self.cables) if cable.kind == "actuated")

    @model_validator(mode="after")
    def _check(self) -> Self:
        rods = [rod.name for rod in self.rods]
        for i, name in enumerate(rods):
            if name in rods[:i]:
                raise ValueError(f"rods.{i}.name: two rods have the name {name}")
        for i, cable in enumerate(self.cables):
            for cap in cable.caps:
                if not 0 <= cap < self.n_caps:
                    raise ValueError(f"cables.{i}.caps: end cap {cap} does not exist, there are {self.n_caps}")
        winched = sorted(motor.cable for motor in self.motors)
        if winched != list(self.actuated):
            raise ValueError(f"motors: one per actuated cable {list(self.actuated)}, received cables {winched}")
        for i, sensor in enumerate(self.sensors):
            if sensor.cable >= len(self.cables):
                raise ValueError(f"sensors.{i}.cable: cable {sensor.cable} does not exist")
            if sensor.cable in (other.cable for other in self.sensors[:i]):
                raise ValueError(f"sensors.{i}.cable: cable {sensor.cable} has two sensors")
        for i, color in enumerate(self.colors):
            if color.rod not in rods:
                raise ValueError(f"colors.{i}.rod: there is no rod {color.rod}, the rods are {', '.join(rods)}")
            if color.rod in (other.rod for other in self.colors[:i]):
                raise ValueError(f"colors.{i}.rod: rod {color.rod} has two colours")
        if len(self.rest_caps_m) != self.n_caps:
            raise ValueError(f"rest_caps_m: one point per end cap ({self.n_caps}), received {len(self.rest_caps_m)}")
        if self.limits.cable_length_min_m >= self.limits.cable_length_max_m:
            raise ValueError("limits: cable_length_min_m must be below cable_length_max_m")
        return self

"""The tables of a world file that describe the camera: where it is, its optics, its noise, what stands before it."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from r2s2r_cli.rig.section import Count, NonNegative, Positive, Real, Section, Share, Vector2, Vector3

Byte = Annotated[int, Field(strict=True, ge=0, le=255)]
Color = tuple[Byte, Byte, Byte]
_LEAST = 1e-9


class CameraNoise(Section):
    """What makes a picture differ from geometry (perception.md section 5). All 0: none."""

    depth_m_per_m2: NonNegative = 0.0012
    """Standard deviation of depth, divided by the squared depth [m/m^2]; 0.0012 is the Kinect family's."""
    correlated_share: Share = 0.5
    """Part of that variance that neighbouring pixels have in common."""
    correlation_px: Positive = 4.0
    """Standard deviation of the blur that makes the common part [px]."""
    jitter_px: NonNegative = 0.5
    """Sideways jitter of where a depth is taken from [px], standard deviation."""
    disparity_px: NonNegative = 0.125
    """Step of the disparity [px]; 0: depth is rounded to its unit alone."""
    baseline_m: Positive = 0.05
    """Of the stereo pair, which makes a disparity a depth [m]."""
    flying_share: Share = 0.3
    """Pixels at the edge of a body whose depth lies between the body and what is behind it."""
    edge_hole_share: Share = 0.3
    """Pixels at the edge of a body without depth."""
    hole_share: Share = 0.02
    """Other pixels without depth."""
    color_sd: NonNegative = 3.0
    """Of every channel, 0 to 255."""
    exposure_s: NonNegative = 0.008
    """Of the colour picture; what moves is blurred over it [s]."""
    exposure_drift: NonNegative = 0.03
    """Slow change of brightness, standard deviation as a part of it."""
    misregistration_px: Vector2 = (1.0, 0.5)
    """Depth picture against colour picture [px], right and down."""


class Occluder(Section):
    """Something that stands in the way: it is seen, and never touched."""

    shape: Literal["sphere", "cylinder"]
    """A ball, or a stick with flat ends (a cable, an arm)."""
    p_m: Vector3
    """Centre of the sphere, or one end of the cylinder [m], frame W."""
    end_m: Vector3 | None = None
    """Other end of the cylinder [m], frame W."""
    radius_m: Positive
    color: Color = (120, 100, 90)
    from_s: NonNegative = 0.0
    """It is there from this time [s] ..."""
    until_s: Positive = 1e9
    """... to this one [s]."""


class Camera(Section):
    """An RGB-D camera. Frame C: x right, y down, z forward; the centre of pixel (u, v) is at (u + 0.5, v + 0.5)."""

    position_m: Vector3 = (0.0, 0.0, 2.0)
    """Of the camera's centre, p_WC [m]."""
    target_m: Vector3 = (0.0, 0.0, 0.0)
    """A point in the middle of the picture [m], frame W."""
    roll_rad: Real = 0.0
    """About the line of sight; at 0 the top of the picture is as far towards W's y (towards z for a level camera) as
    can be [rad]."""
    width: Count = 640
    """[px]"""
    height: Count = 480
    """[px]"""
    fx_px: Positive = 607.7
    fy_px: Positive = 607.7
    cx_px: Positive = 320.0
    cy_px: Positive = 240.0
    depth_unit_m: Positive = 0.00025
    """Length of one count of depth [m]; 0 counts: no depth."""
    range_m: Vector2 = (0.2, 6.0)
    """Nearest and farthest depth that is measured [m]."""
    rate_hz: Positive = 30.0
    clock_offset_s: Real = 12.5
    """What the camera's clock shows at the rig's time 0 [s]."""
    clock_drift: Real = 2e-5
    """How much faster the camera's clock runs, as a part of time."""
    floor_color: Color = (125, 122, 116)
    noise: CameraNoise = CameraNoise()
    occluders: tuple[Occluder, ...] = ()

    def X_WC(self) -> tuple[np.ndarray, np.ndarray]:
        """p_WC (3,) [m] and R_WC (3, 3), whose columns are the camera's axes in W."""
        p_WC = np.array(self.position_m)
        z = np.array(self.target_m) - p_WC
        length = np.linalg.norm(z)
        z = z / length if length > _LEAST else np.array([0.0, 0.0, -1.0])
        up = np.array([0.0, 1.0, 0.0]) if abs(z[2]) > 0.7 else np.array([0.0, 0.0, 1.0])
        down = -(up - (up @ z) * z)
        y = down / np.linalg.norm(down)
        x = np.cross(y, z)
        c, s = np.cos(self.roll_rad), np.sin(self.roll_rad)
        return p_WC, np.column_stack([c * x + s * y, c * y - s * x, z])

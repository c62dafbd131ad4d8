"""What a healthy robot shows, and by how much healthy robots differ: the scale on which a finding is a finding.

Spreads are of the rig's healthy runs (MuJoCo, random shapes, noise of 2 to 10 mm), as `changed` between runs of one
robot on one day and as `built` between a robot and its robot.toml; bias and gain of sensors as built are those of the
real robot's calibration (docs/guides/calibrate.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from schemas.people import quantity


@dataclass(frozen=True)
class Expected:
    """nominal, built: value and spread (sd) without healthy runs to compare with; changed: spread against these. words:
    of the quantity, for people, with {element}. most: further than this from nominal healthy runs have measured
    something else, and are not compared with. reads: what a number without a unit is."""

    unit: str
    nominal: float
    built: float
    changed: float
    words: str
    most: float = float("inf")
    reads: Literal["share", "logarithm", "ratio", ""] = ""

    def number(self, value: float) -> str:
        """A value of the quantity for people, with its unit, to the digits that mean something."""
        if self.reads == "share":
            return f"{quantity(100.0 * value, '1', 2)} %"
        if self.reads == "logarithm":
            return f"{quantity(value, '1', 2)} (a factor of {math.exp(value):.2f})"
        if self.reads == "ratio":
            return f"{value:.4f}"
        return quantity(value, self.unit, 2)


EXPECTED: dict[str, Expected] = {
    "rod_length": Expected(
        "1", 1.0, 0.003, 0.001, "the length of {element} as seen, over that of robot.toml", reads="ratio"
    ),
    "camera_scale": Expected(
        "1", 1.0, 0.003, 0.0007, "the length of all rods as seen, over that of robot.toml", reads="ratio"
    ),
    "dropout": Expected(
        "1", 0.0, 0.02, 0.0005, "the share of frames and caps that are missing or outliers", reads="share"
    ),
    "camera_delay": Expected("s", -0.03, 0.025, 0.006, "how much later than the sensors the camera shows a motion"),
    "sensor_bias": Expected("m", 0.0, 0.002, 0.001, "how much too long {element} reads in the middle of its travel"),
    "sensor_gain": Expected(
        "1", 0.0, 0.02, 0.008, "how much too large {element} shows a change of length", reads="share"
    ),
    "sensor_drift": Expected("m/s", 0.0, 3e-4, 0.0001, "the drift of {element} against the camera"),
    "slope_x": Expected("rad", 0.0, 0.005, 0.002, "the tilt about x of the plane on which the caps stand"),
    "slope_y": Expected("rad", 0.0, 0.005, 0.002, "the tilt about y of the plane on which the caps stand"),
    # Within a run nothing is compared with another day.
    "knock": Expected("m", 0.0, 5e-4, 5e-4, "how far the largest jump of all caps at once stands out from the next"),
    "slope_change": Expected("rad", 0.0, 0.01, 0.01, "the change of that tilt from run to run"),
    # A cap that is 3 mm off on a healthy robot does not stand: it hangs by its cables, hardly over the ground.
    "cap_height": Expected("m", 0.0, 0.001, 0.0002, "how much higher than the others {element} stands", 0.003),
    "winch_speed": Expected(
        "1", 0.0, 0.15, 0.006, "the logarithm of all winding rates over the nominal", reads="logarithm"
    ),
    "winch_rate": Expected(
        "1", 0.0, 0.03, 0.004, "the logarithm of the winding rate of {element} over that of all", reads="logarithm"
    ),
    "in_over_out": Expected(
        "1", 0.0, 0.03, 0.003, "the logarithm of the rates reeling in over those paying out", reads="logarithm"
    ),
    "latency": Expected("s", 0.0, 0.015, 0.0005, "how late ramps start and end beyond the usual lag"),
    "lag": Expected("s", 0.03, 0.02, 0.005, "the time constant with which ramps start and run on"),
    "play": Expected("m", 0.0, 0.001, 0.0001, "the motion that is lost where a winch reverses"),
    "sag": Expected("1/s", 0.0, 0.006, 0.0015, "the loss of winding speed with time"),
    "load": Expected(
        "1", 0.0, 0.012, 0.006, "the loss of winding speed with every other motor that runs", reads="share"
    ),
    "droop": Expected("1", 0.0, 0.2, 0.05, "the loss of speed reeling in at the usual tension", reads="share"),
    "spool": Expected("1/m", 0.7, 1.5, 0.2, "the gain of winding speed with the wound length"),
}
"""By check. A sensor's own lag and half a control tick show as a lag of about 30 ms on a healthy robot; what latency
and play are measured beyond."""

"""One number that a fit may change: its name, range, prior, and the coordinate it is searched in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

FAR = 700.0
"""Coordinate of a bound that lies at infinity, and beyond: next to it floats have no other value than the bound."""


class Coordinate(StrEnum):
    """How a number x in (lower, upper) becomes a coordinate z that an optimiser moves freely."""

    LINEAR = "linear"
    """z = x: for numbers of either sign."""
    LOG = "log"
    """z = ln x: a step is a share of the value. For positive numbers whose range is wide."""
    LOGIT = "logit"
    """z = ln((x - lower) / (upper - x)): cannot leave its range. For shares."""


@dataclass(frozen=True)
class Free:
    """A parameter that is free in a fit. All numbers in `unit`.

    start: value of robot.toml, where a fit begins. lower, upper: hard bounds. prior_sd: standard deviation of a normal
    prior about `mean`, in the coordinate (for LOG: relative); inf: flat within the bounds. what: for people. off: of an
    effect's number that nobody gave a start, the value of a robot without the effect; None: of all others. shape:
    it only says what an effect is like, and does nothing where other numbers of the effect are off.
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    coordinate: Coordinate = Coordinate.LOG
    prior_sd: float = math.inf
    what: str = ""
    off: float | None = None
    shape: bool = False

    @property
    def mean(self) -> float:
        """Of the prior, and what it is held at where data do not show it: a fit of an effect begins beside it."""
        return self.start if self.off is None else self.off

    def to_z(self, value: float) -> float:
        """The coordinate of a value inside the bounds or on them."""
        if self.coordinate is Coordinate.LOG:
            return math.log(value) if value > 0 else -FAR
        if self.coordinate is Coordinate.LOGIT:
            if not self.lower < value < self.upper:
                return -FAR if value <= self.lower else FAR
            return math.log((value - self.lower) / (self.upper - value))
        return value

    def from_z(self, z: float) -> float:
        """The value of a coordinate."""
        if self.coordinate is Coordinate.LOG:
            return math.exp(z)
        if self.coordinate is Coordinate.LOGIT:
            # A fit whose data ask for more than a bound allows goes ever further: its exponential would overflow.
            return self.lower if z < -FAR else self.lower + (self.upper - self.lower) / (1.0 + math.exp(-z))
        return z

    def slope(self, z: float) -> float:
        """Derivative of the value by the coordinate, d value / d z."""
        if self.coordinate is Coordinate.LOG:
            return math.exp(z)
        if self.coordinate is Coordinate.LOGIT:
            if z < -FAR:
                return 0.0
            share = 1.0 / (1.0 + math.exp(-z))
            return (self.upper - self.lower) * share * (1.0 - share)
        return 1.0

    def bounds_z(self) -> tuple[float, float]:
        """Bounds of the coordinate; LOGIT has none that is finite."""
        if self.coordinate is Coordinate.LOGIT:
            return -math.inf, math.inf
        if self.coordinate is Coordinate.LOG:
            return (math.log(self.lower) if self.lower > 0 else -math.inf), math.log(self.upper)
        return self.lower, self.upper


def values_of(frees: tuple[Free, ...], z: np.ndarray) -> np.ndarray:
    """Values of coordinates (n,)."""
    return np.array([free.from_z(float(one)) for free, one in zip(frees, z, strict=True)])


def slopes_of(frees: tuple[Free, ...], z: np.ndarray) -> np.ndarray:
    """Derivatives of values by their coordinates, (n,)."""
    return np.array([free.slope(float(one)) for free, one in zip(frees, z, strict=True)])

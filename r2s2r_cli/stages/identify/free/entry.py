"""An entry of the catalogue, and the rules by which most entries are made from the robot's own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.free.actions import Action, Assign, Place, Scale
from r2s2r_cli.stages.identify.free.base import Coordinate, Free

INSIDE = 0.1
"""A fit does not start on a bound. A number whose value in robot.toml lies on one starts this share of its scale (the
standard deviation of its prior) inside."""


@dataclass(frozen=True)
class Entry:
    """A number that can be free. nominal: its value in robot.toml, which free.start is too unless that lies on a
    bound, or other numbers of its effect do nothing there. family, element: `motor_speed` and 2 of `motor_speed.2`;
    element None: of all. law: of Structure that it needs (`lag`, `droop`) or "". effect: the effect that it belongs
    to, or "". alike: what another number sets and this one adds to, so that no data tell the two apart."""

    free: Free
    action: Action
    nominal: float
    family: str
    element: int | None = None
    law: str = ""
    effect: str = ""
    alike: frozenset[Place] = frozenset()


@dataclass(frozen=True)
class Element:
    """One part of the robot that has a number of its own. label: as in the name after the dot; number: of the part;
    value: in robot.toml; places: where the engine keeps it."""

    label: str
    number: int
    value: float
    places: tuple[Place, ...]


@dataclass(frozen=True)
class Kind:
    """What the numbers of one family have in common.

    factor: bounds are value / factor .. value * factor; at_least, at_most: and no further than that. sd: of the prior,
    relative. scale: in the unit, where robot.toml has 0: then the number is linear from 0 to 10 scale, with this as the
    sd of its prior. what: one sentence, {} for the part.
    """

    name: str
    unit: str
    factor: float
    sd: float
    scale: float
    what: str
    at_least: float = 0.0
    at_most: float = np.inf
    law: str = ""


def common(kind: Kind, elements: Sequence[Element], part: str) -> list[Entry]:
    """One number for all elements: shown is their mean, and each goes with it in proportion. None without elements."""
    return [_entry(kind, kind.name, elements, part, None)] if elements else []


def each(kind: Kind, elements: Sequence[Element], part: str) -> list[Entry]:
    """One number an element, NAME.LABEL."""
    return [
        _entry(kind, f"{kind.name}.{one.label}", [one], f"{part} {one.number}", one.number) for one in elements
    ]  # fmt: skip


def mean(values: Sequence[float]) -> float:
    """The mean; of equal numbers exactly that number."""
    return float(values[0]) if len(set(values)) == 1 else float(np.mean(values))


def inside(value: float, lower: float, upper: float, scale: float) -> float:
    """The value, moved by the rule INSIDE where it lies on a bound or beyond."""
    if value <= lower:
        return _tidy(lower + INSIDE * min(scale, upper - lower))
    if value >= upper:
        return _tidy(upper - INSIDE * min(scale, upper - lower))
    return value


def _tidy(value: float) -> float:
    """The value without the rounding of its last digits, which people would see."""
    return float(f"{value:.12g}")


def _entry(kind: Kind, name: str, elements: Sequence[Element], part: str, number: int | None) -> Entry:
    nominal = mean([one.value for one in elements])
    places = tuple(place for one in elements for place in one.places)
    what = kind.what.format(part)
    if nominal > 0:
        lower = min(max(nominal / kind.factor, kind.at_least), nominal / 1.5)
        lower, upper = _tidy(lower), _tidy(min(nominal * kind.factor, kind.at_most))
        free = Free(name, kind.unit, nominal, lower, upper, Coordinate.LOG, kind.sd, what)
        return Entry(free, Scale(places, nominal), nominal, kind.name, number, kind.law)
    start = inside(0.0, 0.0, 10 * kind.scale, kind.scale)
    free = Free(name, kind.unit, start, 0.0, 10 * kind.scale, Coordinate.LINEAR, kind.scale, what)
    return Entry(free, Assign(places), 0.0, kind.name, number, kind.law)

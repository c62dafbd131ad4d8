"""What must be known of a robot before `robot.toml` can be written: every number with its source, nothing derived."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from r2s2r_cli.stages.init.prism import PRISM_SUPPORT, prism_rest
from r2s2r_cli.stages.init.sixbar import sixbar_rest


class Fact(NamedTuple):
    """A value in SI and where it comes from, as it will stand in a comment; abbreviated as in `facts.LEGEND`."""

    value: float
    source: str


class Part(NamedTuple):
    """One lump of a rod; offset along the rod, mirrored where `pair`."""

    name: str
    pair: bool
    shape: str
    mass: Fact
    offset: Fact
    radius: Fact
    length: Fact | None = None
    inner_radius: Fact | None = None


class HsvFact(NamedTuple):
    """Colour range of one rod."""

    rod: str
    hue: tuple[int, int]


class MotorFact(NamedTuple):
    """Wiring of one winch: cable number is its place in the list."""

    board: str
    sign: int


@dataclass(frozen=True)
class RobotFacts:
    """Everything about one robot that is not derived."""

    name: str
    title: str
    about: tuple[str, ...]
    illustrative: bool
    rods: tuple[tuple[str, str], ...]
    """(name, source of it)"""
    rod_length: Fact
    rod_radius: Fact
    cap_radius: Fact
    parts: tuple[Part, ...]
    rod_mass: Fact
    """What the parts must add up to."""
    actuated: tuple[tuple[int, int], ...]
    passive: tuple[tuple[int, int], ...]
    support: tuple[int, int, int]
    cables_source: str
    actuated_stiffness: Fact
    actuated_damping: Fact
    passive_stiffness: Fact
    passive_damping: Fact
    passive_rest_length: Fact
    motors: tuple[MotorFact, ...]
    board_source: str
    sign_source: str
    no_load: Fact
    speed: Fact
    winch_radius: Fact
    sensors: bool
    p: Fact
    i: Fact
    d: Fact
    tolerance: Fact
    min_length: Fact
    range: Fact
    rate: Fact
    step_timeout: Fact
    cable_length_min: Fact
    cable_length_max: Fact
    cap_height_max: Fact
    friction: Fact
    restitution: Fact
    colors: tuple[HsvFact, ...]

    @property
    def cables(self) -> tuple[tuple[int, int], ...]:
        """All cables, actuated first."""
        return self.actuated + self.passive

    @property
    def guides(self) -> tuple[int, ...]:
        """The passive tendons: they turn the outer rods in the attachment heuristic."""
        return tuple(range(len(self.actuated), len(self.cables)))

    @property
    def rest_edge(self) -> float:
        """Cap distance of a fully extended actuated cable [m]."""
        return self.min_length.value + self.range.value

    def rest_caps(self) -> np.ndarray:
        """End caps at rest p_WE [m], shape (cap, 3)."""
        if self.support == PRISM_SUPPORT and len(self.rods) == 3:
            return prism_rest(self.rod_length.value, self.rest_edge, self.cap_radius.value)
        return sixbar_rest(self.rod_length.value, self.cap_radius.value)

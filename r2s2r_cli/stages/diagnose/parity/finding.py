"""What the parity checks say: findings with size and error, effects that they speak for, settings that are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.parity.knocks import Knock
    from r2s2r_cli.stages.diagnose.parity.stranger import Stranger

MOST_NATS = 60.0
"""However far a finding stands out, it says no more than this for an effect or a channel."""
ABSOLUTE = 0.25
"""Of what a finding is worth that no healthy run could be compared with: what nats are worth was learned on differences
from runs of the same robot, and how far robots are from their robot.toml is known far less well. By hand."""


@dataclass(frozen=True)
class Element:
    """A part that a finding is about. kind: as `ElementFound` of the report has it. index: of the cable for cables and
    sensors, of the motor among those of the robot; None where it is all of the kind, or the kind has no numbers.
    xy_m: of a place on the floor [m], frame W."""

    kind: str
    index: int | None = None
    xy_m: tuple[float, float] | None = None

    def words(self) -> str:
        """For people: `cable 3`, `all sensors`."""
        if self.xy_m is not None:
            return f"the place ({self.xy_m[0]:.2f}, {self.xy_m[1]:.2f}) m"
        if self.kind in ("world", "camera", "place"):
            return f"the {self.kind}"
        return f"all {self.kind}s" if self.index is None else f"{self.kind} {self.index}"


@dataclass(frozen=True)
class Suspicion:
    """An effect that a finding speaks for. effect: its id. size: start values of its own
    parameters in their units, by `parameter` or `parameter.index` as `r2s2r effects` names them; empty where the
    finding says that and not how large. share: of the finding's weight, 0 to 1; look-alikes have a share each."""

    effect: str
    size: Mapping[str, float] = field(default_factory=dict)
    share: float = 1.0


@dataclass(frozen=True)
class Finding:
    """One quantity that was measured without a simulator.

    check: id of the quantity. value, sd: in `unit`. expected, expected_sd: what a robot without effects has: of healthy
    runs (`differential`), else nominal. z: (value - expected) over both errors, 0 where nothing can be said; p:
    two-sided chance of it. what: the finding in words. suspicions: strongest first.
    """

    check: str
    element: Element
    value: float
    sd: float
    unit: str
    expected: float
    expected_sd: float
    differential: bool
    z: float
    p: float
    what: str
    suspicions: tuple[Suspicion, ...] = ()

    def nats(self, suspicion: Suspicion) -> float:
        """What it says for one of its suspicions: half its squared z times the share, MOST_NATS at most [nats]."""
        return suspicion.share * min(0.5 * self.z**2, MOST_NATS)


@dataclass(frozen=True)
class Mismatch:
    """A setting that contradicts the data, so that no effect can be told before it is set right. kind: sign | order |
    unit | rate | gain | robot | motor | commands. what: plainly; expected, received; hint: one line that can be
    pasted."""

    kind: str
    what: str
    expected: str
    received: str
    hint: str


@dataclass(frozen=True)
class Parity:
    """findings: every quantity that could be measured, strongest first. mismatches: settings; with one, nothing else
    is to be believed. missing: what could not be looked at, and why. differential: whether healthy runs were there.
    level: false discovery rate at which findings count as `significant`. knock: of the camera, the largest. stranger:
    what no law of the catalogue has."""

    findings: tuple[Finding, ...]
    mismatches: tuple[Mismatch, ...] = ()
    missing: tuple[str, ...] = ()
    differential: bool = False
    level: float = 0.05
    knock: Knock | None = None
    stranger: Stranger | None = None

    @property
    def significant(self) -> tuple[Finding, ...]:
        """Findings that stand out, with a share of at most `level` false ones among them (Benjamini-Hochberg 1995)."""
        kept = discoveries(np.array([one.p for one in self.findings]), self.level)
        return tuple(one for one, keep in zip(self.findings, kept, strict=True) if keep)

    def nats(self) -> dict[str, dict[int | None, float]]:
        """What all findings say for each effect (`Finding.nats`), the most of each element, by id and index of the
        element (None: of no element). Where there are healthy runs, those that could not be compared with them count
        ABSOLUTE."""
        found: dict[str, dict[int | None, float]] = {}
        for one in self.findings:
            worth = ABSOLUTE if self.differential and not one.differential else 1.0
            for suspicion in one.suspicions:
                own = found.setdefault(suspicion.effect, {})
                own[one.element.index] = max(own.get(one.element.index, 0.0), worth * one.nats(suspicion))
        return found

    def starts(self) -> dict[str, dict[str, float]]:
        """Start values for fits of effects, by id and own parameter: of the strongest finding that says one."""
        found: dict[str, dict[str, float]] = {}
        for one in self.findings:
            for suspicion in one.suspicions:
                own = found.setdefault(suspicion.effect, {}) if suspicion.size else {}
                for name, value in suspicion.size.items():
                    own.setdefault(name, value)
        return found

    def of(self, check: str) -> tuple[Finding, ...]:
        """All findings of one check."""
        return tuple(one for one in self.findings if one.check == check)


def discoveries(p: np.ndarray, level: float) -> np.ndarray:
    """(k,) bool: hypotheses refused with a false discovery rate of at most `level` (Benjamini and Hochberg 1995, for
    tests that are independent or positively dependent); nan: never."""
    kept = np.zeros(len(p), dtype=bool)
    known = np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    good = p[order] <= level * np.arange(1, len(order) + 1) / max(len(order), 1)
    if good.any():
        kept[order[: int(np.flatnonzero(good)[-1]) + 1]] = True
    return kept


def cable_ends(robot: Robot) -> np.ndarray:
    """Caps at both ends of every cable, (cable, 2)."""
    return np.array([cable.caps for cable in robot.cables]).reshape(-1, 2)

"""What about a robot decides the program of its step: topology and switches, nothing that a number can change.

Two robots with equal structures share one trace and one machine code; their numbers are `Parameters`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING

from r2s2r_cli.engine.errors import EngineInputError

if TYPE_CHECKING:
    from r2s2r_cli.engine.hooks import Hooks


class Detach(StrEnum):
    """What the derivative of the ground contact leaves out (design section 6; `engine/detach.py`)."""

    NONE = "none"
    """Nothing: the true derivative of the step, one-sided at contact switches. For fits and covariances."""
    GEOMETRY = "geometry"
    """Contact arms and their inverse masses. Bounded over long horizons, biased (2.4x after 1 s)."""
    IMPULSE = "impulse"
    """The whole ground impulse, as in the paper. Windows well below 1 s only: the tangent grows without bound. Impulses
    between rods stay attached."""


@dataclass(frozen=True)
class Structure:
    """Topology and switches. Hashable: it is the key of the trace.

    cable_rods: (rod, rod) of the two ends of each cable. actuated: cables with a winch, ascending.
    """

    n_rods: int
    cable_rods: tuple[tuple[int, int], ...]
    actuated: tuple[int, ...]
    cubic: bool = False
    """Cable force k x + k2 x^2 + k3 x^3 instead of k x."""
    tendons: bool = False
    """Sensor tendons with a stiffness of their own run beside the cables."""
    axial: bool = True
    """Caps and centre of mass of every rod lie on its axis, and its inertia is that of a body of revolution."""
    lag: bool = False
    """Winches follow their command with a first-order lag."""
    droop: bool = False
    """Winches slow down under tension."""
    rod_contact: bool = True
    detach: Detach = Detach.NONE
    sweeps: int = 3
    """Slip-aware sweeps after the stick solve. Departure: contact.md takes 2; with 3 gaits are a third nearer to the
    penalty integration."""
    effects: tuple[Hooks, ...] = ()
    """Unmodelled laws that are plugged into the step, in this order."""

    def __post_init__(self) -> None:
        _check(self)

    @property
    def n_cables(self) -> int:
        """Number of cables."""
        return len(self.cable_rods)

    @property
    def n_actuated(self) -> int:
        """Number of winched cables; commands have this many entries."""
        return len(self.actuated)

    @property
    def passive(self) -> tuple[int, ...]:
        """Cables without a winch, ascending."""
        return tuple(k for k in range(self.n_cables) if k not in self.actuated)

    @property
    def rod_pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of rods that can collide; empty where rod contact is switched off."""
        if not self.rod_contact:
            return ()
        return tuple((i, j) for i in range(self.n_rods) for j in range(i + 1, self.n_rods))

    def with_effects(self, *effects: Hooks) -> Structure:
        """This structure with `effects` plugged in after those it has; each may switch laws on."""
        made = replace(self, effects=self.effects + effects)
        for effect in effects:
            made = effect.structure(made)
        return made


def _check(structure: Structure) -> None:
    if structure.n_rods < 1:
        raise EngineInputError("n_rods", "a robot has rods", expected="at least 1", received=str(structure.n_rods))
    for k, ends in enumerate(structure.cable_rods):
        if len(ends) != 2 or not all(0 <= rod < structure.n_rods for rod in ends):
            raise EngineInputError(
                f"cable_rods.{k}", "a cable ends on two rods",
                expected=f"two numbers below {structure.n_rods}", received=str(ends),
            )  # fmt: skip
        if ends[0] == ends[1]:
            raise EngineInputError(
                f"cable_rods.{k}", "a cable between two points of one rod does nothing",
                expected="two different rods", received=str(ends),
            )  # fmt: skip
    if not _ascending(structure.actuated) or any(not 0 <= k < structure.n_cables for k in structure.actuated):
        raise EngineInputError(
            "actuated", "winched cables are named once each, ascending",
            expected=f"numbers below {structure.n_cables}", received=str(structure.actuated),
        )  # fmt: skip
    if not isinstance(structure.detach, Detach):
        raise EngineInputError("detach", "unknown", expected=" | ".join(Detach), received=str(structure.detach))
    if structure.sweeps < 1:
        raise EngineInputError("sweeps", "too few sweeps", expected="at least 1", received=str(structure.sweeps))
    names = [effect.name for effect in structure.effects]
    if len(set(names)) < len(names):
        raise EngineInputError(
            "effects", "an effect is plugged in twice", expected="each once", received=", ".join(names)
        )


def _ascending(numbers: Sequence[int]) -> bool:
    return all(a < b for a, b in pairwise(numbers))

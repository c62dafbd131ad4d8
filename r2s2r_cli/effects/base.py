"""The base of every effect of the catalogue: what it is called, where it acts, which numbers it has.

An effect is a physical law that the nominal simulator lacks, and the identity at its off value. To add one, copy the
shortest file beside this one, fill in the headings of its docstring and add the class to `FURTHER`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch

from r2s2r_cli.engine.hooks import Channel, Hooks
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect, or one per element. scale: of its prior, half-normal from the off value."""

    name: str
    unit: str
    lower: float
    upper: float
    off: float
    scale: float
    what: str
    per: str = "robot"
    """robot | rod | cap | cable | actuated | sensor (that of each cable): how many there are."""
    fitted: bool = True
    """Whether a trajectory tells it; what only counts frames (dropout) is measured without a simulator."""
    start: float | None = None
    """Where a fit begins that is told no value: beside off, where other numbers do nothing while this one is off. None:
    at off, or as near as bounds let it."""
    only_shape: bool = False
    """Whether it says only where or how (a place, a width, a time constant beside a strength), and nothing while the
    others are off: it is looked for together with them, and the effect is off whatever it is."""
    tried: tuple[float, ...] = ()
    """Values beside off and scale where it is looked for: those of what happens all at once."""

    def count(self, structure: Structure) -> int:
        """How many numbers it has on a robot."""
        return {
            "robot": 1, "rod": structure.n_rods, "cap": 2 * structure.n_rods, "cable": structure.n_cables,
            "actuated": structure.n_actuated, "sensor": structure.n_cables,
        }[self.per]  # fmt: skip


class Effect(Hooks):
    """An entry of the catalogue. Concrete effects are final: they set the class attributes and override hooks.

    name: its id (docs/reference/effects.md). channel: where it acts. look_alikes: ids it is confused with.
    """

    channel: ClassVar[Channel]
    title: ClassVar[str]
    own: ClassVar[tuple[EffectParameter, ...]]
    look_alikes: ClassVar[tuple[str, ...]] = ()

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={value!r}" for name, value in sorted(vars(self).items()))
        return f"{type(self).__name__}({inside})"

    def __eq__(self, other: object) -> bool:
        return other is self or (type(other) is type(self) and repr(other) == repr(self))

    def __hash__(self) -> int:
        # Structures are keys of caches that are asked all the time: the name will do, and equality tells the rest.
        return hash(self.name)

    def sizes(self, structure: Structure) -> Mapping[str, int]:
        """Own parameters and how many numbers each has."""
        return {parameter.name: parameter.count(structure) for parameter in self.own}

    def off(self, structure: Structure) -> Mapping[str, float]:
        """Off value of each own parameter."""
        del structure
        return {parameter.name: parameter.off for parameter in self.own}

    @classmethod
    @abstractmethod
    def signature(cls) -> str:
        """What it looks like in data, in one sentence."""


def with_off_values(structure: Structure, theta: Parameters) -> Parameters:
    """Parameters with those of all effects of `structure` that they lack set to their off values."""
    values = dict(theta.extra)
    for effect in structure.effects:
        off = effect.off(structure)
        for name, n in effect.sizes(structure).items():
            values.setdefault(
                f"{effect.name}.{name}", torch.full((1, n), off[name], dtype=theta.mass.dtype, device=theta.mass.device)
            )
    return theta.with_values(values)

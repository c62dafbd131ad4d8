"""What a fit is of, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.candidates import Candidate

DAMPING = 1e-3
"""To begin with, over the diagonal of the scaled normal matrix."""
MOVED = 0.02
"""Of the scale: an effect that ends nearer to where it started has not moved."""


@dataclass(frozen=True)
class Hypothesis:
    """What a fit is of. parts: no effect (the refit nominal model), one, or two."""

    parts: tuple[Candidate, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects."""
        return tuple(part.effect for part in self.parts)

    @property
    def label(self) -> str:
        """`cap_friction, cap 3`, or `none`."""
        return " + ".join(part.label for part in self.parts) or "none"

    def stack(self, name: str) -> np.ndarray:
        """A field of all parts, one after the other."""
        return np.concatenate([getattr(part, name) for part in self.parts]) if self.parts else np.zeros(0)

    @property
    def spread(self) -> list[tuple[int, ...]]:
        """Of each of its numbers the places among those of the model."""
        return [places for part in self.parts for places in part.spread]


@dataclass
class Fit:
    """A hypothesis on its way. z (p + q,): nuisances; x (k,): the effect's numbers. residual (M,): white; jacobian
    (M, p + q + k). cost: robust, with priors. start (k,): where it began. away (stretch, offset): where its stretches
    begin, in sd from the arena's; raw: residuals as they are, by stretch (`Arena.raw`). on_bound: numbers that ended on
    a bound."""

    hypothesis: Hypothesis
    z: np.ndarray
    x: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    cost: float
    start: np.ndarray
    away: np.ndarray
    raw: list[np.ndarray]
    damping: float = DAMPING
    ended: bool = False

    @property
    def moved(self) -> bool:
        """Whether the effect's numbers left their start; a fit that never did says nothing of the size."""
        scale = self.hypothesis.stack("scale")
        return bool(np.any(np.abs(self.x - self.start) > MOVED * scale)) if len(self.x) else True

    @property
    def on_bound(self) -> tuple[str, ...]:
        """Names of the effect's numbers that ended on a bound."""
        names = [name for part in self.hypothesis.parts for name in part.names]
        low, high = self.hypothesis.stack("lower"), self.hypothesis.stack("upper")
        at = np.isclose(self.x, low, rtol=0, atol=1e-9) | np.isclose(self.x, high, rtol=0, atol=1e-9)
        return tuple(name for name, bound in zip(names, at, strict=True) if bound)

"""What the default fit does where nobody says otherwise: free parameters, windows, noise, starts."""

from __future__ import annotations

from dataclasses import dataclass, field

from r2s2r_cli.stages.identify.offsets import StartSpread
from r2s2r_cli.stages.identify.start import Filter

PAPER_FREE = ("motor_speed", "friction")
"""The two parameters of the paper."""


@dataclass(frozen=True)
class Recipe:
    """How a fit is made. window: target intervals of a training window. noise [m]: see CapResiduals. key_only: compare
    key frames only. refreshes: how often start states are made again with the parameters found. max_iterations: of
    the last horizon, each time. loss: name in solve.LOSSES. belief, spread: of start states. step [s]: of the engine.
    """

    window: int = 7
    noise: float = 1e-3
    key_only: bool = False
    refreshes: int = 2
    max_iterations: int = 40
    loss: str = "student_t"
    belief: Filter = field(default_factory=Filter)
    spread: StartSpread = field(default_factory=StartSpread)
    step: float = 1e-3

    def horizons(self, longest: int) -> tuple[int, ...]:
        """Intervals that the stages of a growing fit cover, for windows of at most `longest`: 1, 2, 4 ... all."""
        found = [1]
        while 2 * found[-1] < longest:
            found.append(2 * found[-1])
        return tuple(found) if found[-1] >= longest else (*found, longest)

"""All that a diagnosis found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import FloorGiven
from r2s2r_cli.stages.diagnose.much.shrink import Shrinkage
from r2s2r_cli.stages.diagnose.next_gait import NextGait
from r2s2r_cli.stages.diagnose.parity import Parity
from r2s2r_cli.stages.diagnose.where import Where
from r2s2r_cli.stages.diagnose.where.seat import Seat, seat
from r2s2r_cli.stages.diagnose.which.found import Which


@dataclass(frozen=True)
class SegmentSeen:
    """One fitted target interval, left out of the fit. refit, effect: cap RMSE at its end [m], without and with the
    best effect, None where none was fitted. misfit: squares over what noise and floor explain; gap: it stands out. t
    [s]: of start and end. key, error (cap, 3) [m]: observed caps there, and simulated minus observed ones."""

    run: str
    interval: int
    gait: str
    t: tuple[float, float]
    refit: float
    effect: float | None
    misfit: float
    gap: bool
    key: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class Diagnosis:
    """parity, where: None where they were left out (an ablation). refit: numbers of the refit nominal model by name, as
    (value, sd). rollouts: simulated stretches. warnings: for people. actuated: cable of every motor, empty: of its own
    number."""

    robot: str
    floor: FloorGiven
    parity: Parity | None
    where: Where | None
    which: Which
    much: Shrinkage | None
    next_gait: NextGait | None
    refit: dict[str, tuple[float, float]]
    segments: tuple[SegmentSeen, ...]
    within_run: bool
    rollouts: int
    warnings: tuple[str, ...] = ()
    actuated: tuple[int, ...] = ()

    @property
    def seat(self) -> Seat:
        """Channel and element of the cause."""
        return seat(self.which, self.where, self.actuated)

    @property
    def channel(self) -> str | None:
        """Where the cause acts."""
        return self.seat.channel

"""How far engine and rig are apart when nothing is wrong with either: as values; `commands` lets both run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import Group


@dataclass(frozen=True)
class Numerics:
    """Random gait steps from common states. seed, error, way: (gait,), the last two cap RMSE [m]. Steps in [s]."""

    seed: np.ndarray
    error: np.ndarray
    way: np.ndarray
    engine_step: float
    rig_step: float

    @property
    def floor(self) -> float:
        """Root mean square over the gait steps [m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    def to_group(self) -> Group:
        """As the group `numerics` of floor.h5."""
        return Group(
            {"seed": self.seed.astype(np.int64), "error": self.error, "way": self.way},
            {
                "floor": self.floor, "median": float(np.median(self.error)), "worst": float(self.error.max()),
                "moved": float(np.median(self.way)), "engine_step": self.engine_step, "rig_step": self.rig_step,
            },
        )  # fmt: skip


def cap_rmse(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Root of the mean over the caps of the squared distance, (...,) [m], of end caps (..., cap, 3)."""
    return np.asarray(np.sqrt(np.sum((a - b) ** 2, axis=-1).mean(axis=-1)))

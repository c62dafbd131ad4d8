"""Key-frame and free-run errors of end caps (docs/concepts/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class KeyframeErrors:
    """Squared 3-D distances at key frames, (segment, cap) [m^2]; a row of NaN: nothing was predicted there."""

    squared: np.ndarray

    @property
    def judged(self) -> np.ndarray:
        """Whether the segment was predicted, (segment,)."""
        return np.isfinite(self.squared).all(axis=1)

    @property
    def rmse_m(self) -> float | None:
        """Key-frame cap RMSE: root of the mean over caps and judged segments [m]; None where none was predicted."""
        return float(np.sqrt(self.squared[self.judged].mean())) if self.judged.any() else None

    @property
    def mse(self) -> np.ndarray:
        """Mean over caps (segment,) [m^2], NaN where nothing was predicted: what is resampled by the bootstrap."""
        return self.squared.mean(axis=1)

    @property
    def per_segment_m(self) -> np.ndarray:
        """Root mean square over caps (segment,) [m], NaN where nothing was predicted."""
        return np.sqrt(self.mse)


def keyframe_errors(observed: np.ndarray, simulated: np.ndarray) -> KeyframeErrors:
    """Of observed and simulated end caps at the key frames, both (segment, cap, 3) [m].

    Raises ValueError where the shapes differ or an observation is not finite. A simulated segment with NaN counts as
    not predicted: it is left out and `judged` says so.
    """
    if observed.shape != simulated.shape or observed.ndim != 3:
        raise ValueError(f"expected (segment, cap, 3) twice, got {observed.shape} and {simulated.shape}")
    if not np.isfinite(observed).all():
        raise ValueError("an observed key frame is not finite")
    squared = np.sum((simulated - observed) ** 2, axis=-1)
    squared[~np.isfinite(squared).all(axis=1)] = np.nan
    return KeyframeErrors(squared)


def frame_rmse(observed: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """Root mean square over caps of the 3-D distance (frame,) [m], of end caps (frame, cap, 3) [m]."""
    if observed.shape != simulated.shape:
        raise ValueError(f"expected equal shapes, got {observed.shape} and {simulated.shape}")
    return np.sqrt(np.sum((simulated - observed) ** 2, axis=-1).mean(axis=-1))


def free_run(observed: np.ndarray, simulated: np.ndarray) -> float:
    """Mean over frames of the per-frame cap RMSE [m]; the frame of the start counts, as every other one."""
    return float(frame_rmse(observed, simulated).mean())

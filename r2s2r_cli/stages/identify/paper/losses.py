"""The Key Frame Loss and its rivals by name: which frames are compared, and what is detached.

| name | starts | compared | state between windows |
| --- | --- | --- | --- |
| key_frame | segments | the key frame | detached |
| last_step | segments | the key frame | attached |
| all_step | segments | all common frames | attached |
| naive | the whole run | all frames, by the clock | - |
| multiple_shooting | n windows of equal time | the window's last frame | the observed state, velocities included |

Paper: sections Key Frame Loss and System Identification with Synthetic Trajectories, appendix Comparison to
Alternatives. The paper says "the differences in the positions of the end caps" and leaves the norm open; see `Norm`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor


class Loss(StrEnum):
    """The losses of the paper."""

    KEY_FRAME = "key_frame"
    ALL_STEP = "all_step"
    LAST_STEP = "last_step"
    NAIVE = "naive"
    MULTIPLE_SHOOTING = "multiple_shooting"


class Norm(StrEnum):
    """What a difference of positions is."""

    SQUARED = "squared"
    """Squared distance [m^2]."""
    DISTANCE = "distance"
    """Distance [m]; its derivative does not fade towards the truth, and no single cap outweighs the others."""


TINY = 1e-9
"""[m] see `defect`."""


@dataclass(frozen=True)
class Window:
    """One window. p_WE: simulated end caps at the ticks [m], (tick, cap, 3), with their derivative; at: where they are
    read off, in ticks from the first row, (k,); observed: real end caps there [m], (k, cap, 3)."""

    p_WE: Tensor
    at: np.ndarray
    observed: np.ndarray


@dataclass(frozen=True)
class LossValue:
    """total: mean over the kept windows, a scalar to differentiate; parts: of every window, (window,), [m^2] or [m]
    as the norm says; kept: which count, (window,), bool."""

    total: Tensor
    parts: Tensor
    kept: np.ndarray


def loss_value(windows: list[Window], kept: np.ndarray | None = None, norm: Norm = Norm.SQUARED) -> LossValue:
    """Mean defect of each window, and the mean of those over the windows that are kept."""
    import torch

    parts = torch.stack([defect(window, norm) for window in windows])
    which = np.ones(len(windows), dtype=bool) if kept is None else kept
    return LossValue(parts[torch.as_tensor(which)].mean(), parts, which)


def defect(window: Window, norm: Norm = Norm.SQUARED) -> Tensor:
    """Mean difference of the compared frames and caps."""
    import torch

    apart = ((between(window.p_WE, window.at) - torch.as_tensor(window.observed)) ** 2).sum(-1)
    # No derivative at 0, where a cap is where it should be: 1 nm keeps it finite.
    return apart.mean() if norm is Norm.SQUARED else torch.sqrt(apart + TINY**2).sub(TINY).mean()


def between(rows: Tensor, at: np.ndarray) -> Tensor:
    """Rows (tick, ...) at fractional ticks `at` (k,) by linear interpolation, differentiable in the rows."""
    import torch

    low = np.clip(np.floor(at + 1e-9).astype(int), 0, max(len(rows) - 2, 0))
    share = torch.as_tensor(np.clip(at - low, 0.0, 1.0)).reshape(-1, *[1] * (rows.ndim - 1))
    high = np.minimum(low + 1, len(rows) - 1)
    return rows[low] + share * (rows[high] - rows[low])

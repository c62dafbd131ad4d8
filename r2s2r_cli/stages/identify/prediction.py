"""What is predicted of windows: they go in groups of about the same length, and come back in their own order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.windows import Window

LONGER = 1.3
"""Windows are simulated together while the longest lasts at most so many times the shortest: all run as long."""


@dataclass(frozen=True)
class Prediction:
    """p_WE: end caps at the compared frames of all windows, one after the other, as the camera sees them [m],
    (F, cap, 3); window: which window each frame is of, (F,). by_value (F, cap, 3, n) [m per unit], by_offset
    (F, cap, 3, offset): derivatives by parameters and by the offsets of the frame's own window; None if not asked."""

    p_WE: np.ndarray
    window: np.ndarray
    by_value: np.ndarray | None = None
    by_offset: np.ndarray | None = None


def alike(windows: Sequence[Window]) -> list[list[int]]:
    """Numbers of the windows in groups of about the same length."""
    groups: list[list[int]] = []
    for k in sorted(range(len(windows)), key=lambda k: windows[k].duration):
        if groups and windows[k].duration <= LONGER * windows[groups[-1][0]].duration:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def joined(groups: Sequence[Sequence[int]], parts: Sequence[Prediction], count: int) -> Prediction:
    """The predictions of groups of windows as one, in the order of the windows."""
    place = {k: (part, i) for part, group in enumerate(groups) for i, k in enumerate(group)}
    rows = [(parts[part], parts[part].window == i) for part, i in (place[k] for k in range(count))]

    def one(name: str) -> np.ndarray | None:
        if getattr(parts[0], name) is None:
            return None
        return np.concatenate([getattr(part, name)[mask] for part, mask in rows])

    p_WE = one("p_WE")
    assert p_WE is not None  # noqa: S101 - every prediction has it
    window = np.concatenate([np.full(int(mask.sum()), k) for k, (_, mask) in enumerate(rows)])
    return Prediction(p_WE, window, one("by_value"), one("by_offset"))

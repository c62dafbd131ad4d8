"""What the pass over the images keeps of every frame, and when a second look at one is worth more than the first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.vision.sightings import HIDDEN

ALIKE_M = 0.01
"""[m] Two looks at a frame that put a cap no farther apart agree on it."""
ENOUGH = 3
"""So many caps on which both agree, and none that only the second sees: from there on there is nothing new."""


@dataclass(frozen=True)
class Look:
    """A look at one frame.

    p_WE: sightings [m] (cap, 3), NaN where there is none; cov: theirs (cap, 3, 3). used: those that fit the filter,
    bool (cap,). visible, code: see vision/sightings.py, (cap,). shift_px: depth against colour, (2,).
    """

    p_WE: np.ndarray
    cov: np.ndarray
    used: np.ndarray
    visible: np.ndarray
    code: np.ndarray
    shift_px: np.ndarray


class Rows:
    """Of all frames: p_WE (frame, cap, 3) [m], NaN where not sighted, cov, visible, code, shift_px as in `Look`."""

    def __init__(self, frames: int, caps: int) -> None:
        self.p_WE = np.full((frames, caps, 3), np.nan)
        self.cov = np.full((frames, caps, 3, 3), np.nan)
        self.visible = np.zeros((frames, caps))
        self.code = np.full((frames, caps), HIDDEN, dtype=np.uint8)
        self.shift_px = np.full((frames, 2), np.nan)

    def keep(self, k: int, look: Look, kept: np.ndarray) -> None:
        """Write frame k; of its sightings those that are `kept`, bool (cap,)."""
        self.p_WE[k] = np.where(kept[:, None], look.p_WE, np.nan)
        self.cov[k], self.visible[k], self.code[k], self.shift_px[k] = look.cov, look.visible, look.code, look.shift_px

    def agree(self, k: int, look: Look) -> bool:
        """Whether a second look at frame k tells nothing new."""
        off = np.linalg.norm(self.p_WE[k] - look.p_WE, axis=1)[look.used]
        return bool(len(off) >= ENOUGH and np.all(off < ALIKE_M))  # False where one is NaN

    def better(self, k: int, look: Look) -> bool:
        """Whether a second look at frame k tells of at least as many caps as the first."""
        return bool(np.sum(look.used) >= max(int(np.sum(np.isfinite(self.p_WE[k, :, 0]))), 1))

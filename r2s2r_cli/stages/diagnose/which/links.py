"""How a piece goes on from the one before it: where that one ended is where it begins.

A start that is only seen is known as well as a frame or two. Simulated on from the piece before, it is known as well as
all the frames of that piece together say. Only one piece back: where a robot falls at another instant than the
simulated one, everything after it would be lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.stretches import Stretch

NEAR_S = 1e-6
"""Between the last frame of a piece and the first of the next."""
ROLL_SD = 0.05
"""[rad] What a simulator errs by in a piece in the roll of a rod, and [rad/s] in its rate."""
SPEED_SD = 0.01
"""[m/s] The same of a rod's speed."""
REST_SD_M = 1e-3
"""[m] The same of a rest length."""
FAR, FAR_HIDDEN = 30.0, 3.0
"""[sd] Beyond which an end is not followed: of what caps show, and of rolls and rest lengths."""


@dataclass(frozen=True)
class Link:
    """From the piece before to a stretch. before: its place; start (offset, channel F): from its rooted residuals to
    the offsets of this one. responses (offset, channel, F): what one sd
    of each offset changes here; root (offset, offset): of the covariance of the offsets."""

    before: int
    start: np.ndarray
    responses: np.ndarray
    root: np.ndarray

    def middle(self, ahead: np.ndarray, rooted: np.ndarray) -> np.ndarray:
        """Where the stretch most likely begins, (k, offset) [sd], if the piece before ends at `ahead` (k, offset) [sd]
        and leaves rooted residuals (k, channel F)."""
        return np.asarray(ahead - rooted @ self.start.T)

    def shift(self, begun: np.ndarray) -> np.ndarray:
        """What residuals are more for beginning there (k, offset) [sd], (k, channel, F)."""
        return np.asarray(np.einsum("ko,ocf->kcf", begun, self.responses))


@dataclass(frozen=True)
class Way:
    """What links of a stretch are made of. through (offset, offset): its start by that of the piece before, in their
    sd; rough (draw, offset): what straight lines do not tell of the end of that piece; sd (offset,): of its own start
    as it is seen; lasts [s]: the piece before."""

    before: int
    through: np.ndarray
    rough: np.ndarray
    responses: np.ndarray
    sd: np.ndarray
    lasts: float
    rods: int

    def link(self, to_start: np.ndarray, known: np.ndarray, floor_m: float) -> Link:
        """to_start, known: of the piece before (`white.Kind`), seen alone. floor_m: of the simulator, per second."""
        n = len(self.through)
        spread = self.through @ known[:n]
        more = self.errs(floor_m) / self.sd
        covariance = spread @ spread.T + self.rough.T @ self.rough + np.diag(more**2)
        return Link(self.before, self.through @ to_start[:n], self.responses, np.linalg.cholesky(covariance))

    def errs(self, floor_m: float) -> np.ndarray:
        """Sd of where a simulator of that floor ends a piece, (offset,) in the units of `offsets.StartSpread`."""
        place = floor_m * np.sqrt(self.lasts / 3.0)
        n = 3 * self.rods
        position, velocity = self.sd[:n], self.sd[2 * n : 3 * n]
        tilt, rate = self.sd[n : 2 * n], self.sd[3 * n : 4 * n]
        found = np.full(len(self.sd), REST_SD_M)
        found[:n], found[2 * n : 3 * n] = place, SPEED_SD
        # A rod's tilts have the sd of its place over its length, as where it is seen.
        found[n : 2 * n], found[3 * n : 4 * n] = place * tilt / position, SPEED_SD * rate / velocity
        found[n + 2 : 2 * n : 3] = found[3 * n + 2 : 4 * n : 3] = ROLL_SD
        return found


def befores(many: Sequence[Stretch]) -> list[int | None]:
    """Of every stretch the place of the one that ends where it begins."""
    ends = {(one.run, round(one.until / NEAR_S)): k for k, one in enumerate(many)}
    return [ends.get((one.run, round(one.window.start / NEAR_S))) for one in many]


def followed(offsets: np.ndarray, rods: int) -> np.ndarray:
    """Offsets (..., offset) [sd], as far as they are followed; of what left the finite numbers, FAR."""
    far = np.full(offsets.shape[-1], FAR)
    far[12 * rods :] = FAR_HIDDEN
    far[3 * rods + 2 : 6 * rods : 3] = far[9 * rods + 2 : 12 * rods : 3] = FAR_HIDDEN
    return np.clip(np.nan_to_num(offsets, nan=FAR), -far, far)

"""How residuals of one stretch become white: noise, a floor that grows along it, and where it starts.

Offsets of a start are normal numbers of their own, so they are not fitted: they are part of the covariance, the same
for every hypothesis. So is the floor, a simulator's own error, which grows along a stretch like a random walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.mixture import FACTORS
from r2s2r_cli.stages.diagnose.which.stretches import Stretch

ABSENT = 1e3
"""[m] Sd of a reading that is not there."""
OFFSET_SHARE = 0.3
"""Of the noise of a frame: what a tracker is off by all along a stretch."""
TINY = 1e-9
"""Of a square of a singular value, below which an offset changes nothing."""
FLOOR_S = 1.0
"""The floor is what a simulator errs by after so long."""


@dataclass(frozen=True)
class Kind:
    """Residuals white under one kind of error. roots (channel, F, F): inverse Cholesky factors of noise and floor; U
    (channel F, offset), shrink (offset,): what is taken off along the offsets of the start. rows: their place among all
    white residuals; logdet: of the covariance. to_start (offset, channel F): from rooted residuals to the offsets;
    known (offset, offset): root of their covariance once the residuals are seen."""

    roots: np.ndarray
    U: np.ndarray
    shrink: np.ndarray
    rows: slice
    logdet: float
    to_start: np.ndarray
    known: np.ndarray

    def rooted(self, residual: np.ndarray) -> np.ndarray:
        """(k, channel, F) -> (k, channel F), white but for the start."""
        return _rooted(self.roots, residual)

    def white(self, residual: np.ndarray) -> np.ndarray:
        """(k, channel, F) -> (k, channel F), white."""
        return self.off_start(self.rooted(residual))

    def off_start(self, rooted: np.ndarray) -> np.ndarray:
        """Of `rooted` ones (..., channel F), white."""
        return np.asarray(rooted - ((rooted @ self.U) * self.shrink) @ self.U.T)

    def start(self, rooted: np.ndarray) -> np.ndarray:
        """Offsets of the start [sd] that most likely left `rooted` residuals (channel F), (offset,)."""
        return np.asarray(-(self.to_start @ rooted))


@dataclass(frozen=True)
class White:
    """One stretch. kinds: as the floor says, and far worse; size: how many residuals are data."""

    kinds: tuple[Kind, ...]
    size: int

    @property
    def rows(self) -> slice:
        """Of the kind that the floor explains."""
        return self.kinds[0].rows

    @property
    def logdet(self) -> np.ndarray:
        """Of both kinds, (kind,)."""
        return np.array([kind.logdet for kind in self.kinds])

    def white(self, residual: np.ndarray) -> np.ndarray:
        """(k, channel, F) -> (k, channel F), white as far as the floor explains it."""
        return self.kinds[0].white(residual)


def whites(
    many: Sequence[Stretch], by_offset: Sequence[np.ndarray], *, sensors: int, floor_m: float, noise: float,
    lasts: float,
) -> tuple[White, ...]:  # fmt: skip
    """Of all stretches. by_offset: what one sd of each offset of their starts changes, (offset, channel, F);
    sensors: channels after those of the caps; noise: factor on the stated noise; lasts [s]: time in which the
    correlation of a cap's errors falls to 1/e, 0: they are white. Rows: those of the first kind of all stretches come
    before those of the next kind."""
    total = sum(d.shape[1] * d.shape[2] for d in by_offset)
    begin, found = 0, []
    for one, d in zip(many, by_offset, strict=True):
        count = d.shape[1] * d.shape[2]
        kinds = []
        for c, factor in enumerate(FACTORS):
            roots, size = _roots(one, sensors, factor * floor_m, noise, lasts)
            V = _rooted(roots, d)
            # Of the small matrix: singular values of the tall one take ten times as long, and only large ones matter.
            square, W = np.linalg.eigh(V @ V.T)
            square = np.maximum(square, TINY)
            U, shrink = (V.T @ W) / np.sqrt(square), 1.0 - 1.0 / np.sqrt(1.0 + square)
            logdet = float(np.log1p(square).sum() - 2.0 * np.log(np.diagonal(roots, axis1=1, axis2=2)).sum())
            first = c * total + begin
            to_start = (W / (1.0 + square)) @ W.T @ V
            known = (W / np.sqrt(1.0 + square)) @ W.T
            kinds.append(Kind(roots, U, shrink, slice(first, first + count), logdet, to_start, known))
        found.append(White(tuple(kinds), size))
        begin += count
    return tuple(found)


def whitened(many: Sequence[White], raw: Sequence[np.ndarray]) -> np.ndarray:
    """Residuals (k, channel, F) of every stretch, white under each kind, (k, M)."""
    kinds = range(len(FACTORS))
    return np.concatenate(
        [white.kinds[c].white(r) for c in kinds for white, r in zip(many, raw, strict=True)], axis=1
    )  # fmt: skip


def _roots(one: Stretch, sensors: int, floor_m: float, noise: float, lasts: float) -> tuple[np.ndarray, int]:
    """Inverse Cholesky factors of every channel, and how many numbers are data."""
    since = (one.t - one.window.start) / FLOOR_S
    walk = np.minimum(since[:, None], since[None, :]) * (floor_m**2 / 3.0)
    sd = one.noise.reshape(len(since), -1).T * noise
    size = sd.size
    if sensors:
        absent = np.full((sensors, len(since)), ABSENT)
        if one.length is not None and one.length_sd is not None:
            there = np.isfinite(one.length).T
            absent = np.where(there, one.length_sd.T, ABSENT)
            size += int(there.sum())
        sd = np.concatenate([sd, absent])
    alike = np.repeat(np.eye(len(since))[None], len(sd), axis=0)
    if lasts > 0:
        alike[: len(sd) - sensors] = np.exp(-np.abs(since[:, None] - since[None, :]) / lasts)
    offset = np.zeros((len(sd), 1, 1))
    offset[: len(sd) - sensors, 0, 0] = OFFSET_SHARE * noise * one.frame_noise.ravel()
    covariance = walk[None] + offset**2 + alike * sd[:, :, None] * sd[:, None, :]
    return np.linalg.inv(np.linalg.cholesky(covariance)), size


def _rooted(roots: np.ndarray, residual: np.ndarray) -> np.ndarray:
    found = np.matmul(residual.transpose(1, 0, 2), roots.transpose(0, 2, 1))  # (channel, k, F)
    return np.ascontiguousarray(found.transpose(1, 0, 2)).reshape(len(residual), -1)

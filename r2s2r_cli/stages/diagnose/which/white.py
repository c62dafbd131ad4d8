"""How residuals of one stretch become white: noise, a floor that grows along it, and where it starts.

Offsets of a start are normal numbers of their own, so they are not fitted: they are part of the covariance, the same
for every hypothesis. So is the floor, a simulator's own error, which grows along a stretch like a random walk.

A piece that comes after another one of its run begins where that one ended: what its frames say of its own start goes
on through the simulation (`links`). One frame under 5 mm of noise tells a start to 5 mm, the frames of a piece to one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.diagnose.which.links import Link, Way
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

Alone = dict[int, np.ndarray]
"""Rooted residuals of stretches seen alone (k, channel F), by place."""


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
    link: Link | None = None

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
        """Offsets of the start that most likely left `rooted` residuals (..., channel F), (..., offset)."""
        return np.asarray(-(rooted @ self.to_start.T))

    @property
    def spread(self) -> np.ndarray:
        """Root of the covariance of where it begins once the residuals are seen, in sd of the start as it is seen,
        (offset, offset): rows of it are added up."""
        return self.known if self.link is None else self.known @ self.link.root.T


@dataclass(frozen=True)
class White:
    """One stretch. kinds: as the floor says, and far worse; size: how many residuals are data."""

    kinds: tuple[Kind, ...]
    size: int

    def residual(self, raw: np.ndarray) -> np.ndarray:
        """Of raw residuals (..., n) what is seen, (..., channel, F)."""
        channels, frames = self.kinds[0].roots.shape[:2]
        return raw[..., : channels * frames].reshape(*raw.shape[:-1], channels, frames)

    def ahead(self, raw: np.ndarray) -> np.ndarray:
        """Of raw residuals (..., n) where the piece before ends, (..., offset)."""
        channels, frames = self.kinds[0].roots.shape[:2]
        return raw[..., channels * frames :]

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
    many: Sequence[Stretch], by_offset: Sequence[np.ndarray], ways: Sequence[Way | None], *, sensors: int,
    floor_m: float, noise: float, lasts: float,
) -> tuple[White, ...]:  # fmt: skip
    """Of all stretches. by_offset: what one sd of each offset of their starts changes, (offset, channel, F); ways: from
    the pieces before; sensors: channels after those of the caps; noise: factor on the stated noise; lasts [s]: time in
    which the correlation of a cap's errors falls to 1/e, 0: they are white. Rows: those of the first kind of all
    stretches come before those of the next kind."""
    total = sum(d.shape[1] * d.shape[2] for d in by_offset)
    begin, firsts, sizes = 0, [], []
    for d in by_offset:
        firsts.append(begin)
        begin += d.shape[1] * d.shape[2]
    alone: list[list[Kind]] = []
    for one, d, first in zip(many, by_offset, firsts, strict=True):
        made: list[Kind] = []
        for c, factor in enumerate(FACTORS[1:], start=1):
            roots, size = _roots(one, sensors, factor * floor_m, noise, lasts)
            made.append(_kind(roots, d, c * total + first))
        alone.append([replace(made[0], rows=slice(first, first + d.shape[1] * d.shape[2])), *made])
        sizes.append(size)
    found = []
    for k, (kinds, way) in enumerate(zip(alone, ways, strict=True)):
        if way is not None:
            before = alone[way.before][1]
            link = way.link(before.to_start, before.known, floor_m)
            d = np.concatenate([np.einsum("ol,ocf->lcf", link.root, link.responses), by_offset[k][len(link.root) :]])
            kinds = [replace(_kind(kinds[0].roots, d, kinds[0].rows.start), link=link), *kinds[1:]]
        found.append(White(tuple(kinds), sizes[k]))
    return tuple(found)


def _kind(roots: np.ndarray, d: np.ndarray, first: int) -> Kind:
    """One kind of error. d (offset, channel, F): what offsets of the start change."""
    V = _rooted(roots, d)
    # Of the small matrix: singular values of the tall one take ten times as long, and only large ones matter.
    square, W = np.linalg.eigh(V @ V.T)
    square = np.maximum(square, TINY)
    U, shrink = (V.T @ W) / np.sqrt(square), 1.0 - 1.0 / np.sqrt(1.0 + square)
    logdet = float(np.log1p(square).sum() - 2.0 * np.log(np.diagonal(roots, axis1=1, axis2=2)).sum())
    to_start = (W / (1.0 + square)) @ W.T @ V
    known = (W / np.sqrt(1.0 + square)) @ W.T
    return Kind(roots, U, shrink, slice(first, first + V.shape[1]), logdet, to_start, known)


def whitened(many: Sequence[White], raw: Sequence[np.ndarray]) -> np.ndarray:
    """Raw residuals (k, n) of every stretch (`Arena.raw`), white under each kind, (k, M)."""
    kinds = range(len(FACTORS))
    alone: Alone = {}
    parts = [whitened_of(many, raw, k, alone) for k in range(len(many))]
    return np.concatenate([part[c] for c in kinds for part in parts], axis=1)


def whitened_of(
    many: Sequence[White], raw: Sequence[np.ndarray] | Mapping[int, np.ndarray], k: int, alone: Alone | None = None
) -> list[np.ndarray]:  # fmt: skip
    """Raw residuals of the stretch k, white under each kind, (k, channel F) each. alone: as `rooted_alone`."""
    alone = {} if alone is None else alone
    own, (first, second, *others) = many[k].residual(raw[k]), many[k].kinds
    found = [second.off_start(rooted_alone(many, raw, k, alone)), *(kind.white(own) for kind in others)]
    # Without a link the first kind is the second one.
    if first.link is None:
        return [found[0], *found]
    return [first.white(own + first.link.shift(begun(many, raw, k, alone))), *found]


def begun(
    many: Sequence[White], raw: Sequence[np.ndarray] | Mapping[int, np.ndarray], k: int, alone: Alone
) -> np.ndarray:  # fmt: skip
    """Where a linked stretch begins by the piece before and what its frames say, in sd of its start, (k, offset)."""
    link = many[k].kinds[0].link
    assert link is not None  # noqa: S101 - only linked ones are asked for
    return link.middle(many[k].ahead(raw[k]), rooted_alone(many, raw, link.before, alone))


def rooted_alone(
    many: Sequence[White], raw: Sequence[np.ndarray] | Mapping[int, np.ndarray], k: int, alone: Alone
) -> np.ndarray:  # fmt: skip
    """Rooted residuals of the stretch k seen alone. alone: those that are known, by stretch, to which it is added: the
    next one asks for them again."""
    if k not in alone:
        alone[k] = many[k].kinds[1].rooted(many[k].residual(raw[k]))
    return alone[k]


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

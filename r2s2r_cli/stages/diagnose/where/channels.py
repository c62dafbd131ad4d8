"""Probes fitted to intervals by ridge, their spread learned from the data, and scored on gaits that were left out.

The number c of a probe in an interval is normal about a mean that all intervals share, with a variance of its own probe
(automatic relevance: one that explains nothing shrinks to 0). Both and the nuisances are found by expectation
maximisation, weighed by how a piece errs (`which/mixture.py`); pieces of a gait that was left out are then scored with
c unknown, so that freedom alone gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.where.columns import Design
from r2s2r_cli.stages.diagnose.which.mixture import minus_log, weight

ROUNDS = 12
ENOUGH_NATS = 15.0
"""No interval says more than this for or against a probe: a robot that tips over, or not, is explained by anything."""
LEAST, MOST = 1e-4, 16.0
"""Variances of a probe over its prior scale stay within these."""
NO_WEIGHT = 1e-14
"""A kind of error that is less likely for a stretch says nothing of nuisances and means."""


@dataclass(frozen=True)
class Spread:
    """nuisance (q,): how far they move; mean, variance (K,): of the probes over their scales."""

    nuisance: np.ndarray
    mean: np.ndarray
    variance: np.ndarray


def fitted(design: Design, places: np.ndarray, rows: np.ndarray) -> Spread:
    """Of the probes `places` (K,) from the stretches `rows`."""
    return _fitted(design, _part(design, places), places, rows)


def _fitted(design: Design, part: np.ndarray, places: np.ndarray, rows: np.ndarray) -> Spread:
    """part: products of the probes `places` (`_part`)."""
    q, K = design.q, len(places)
    varies = np.array([design.columns[k].varies for k in places], dtype=bool)
    mean, variance, nuisance = np.zeros(K), np.where(varies, 0.25, LEAST), np.zeros(q)
    T = part[rows]
    logdet, size = design.logdet[rows], design.size[rows]
    for _ in range(ROUNDS if K else 3):
        free = _free(T, q, variance)
        w = weight(_squares(T, free, _left(nuisance, mean)), logdet + free.logdet, size)
        V = _normal(T, free, w)
        H, g = V[: q + K, : q + K], V[: q + K, -1]
        H[:q, :q] += design.known
        H[q:, q:] += np.eye(K)
        unit = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12))
        both = unit * np.linalg.solve(unit[:, None] * H * unit + 1e-9 * np.eye(q + K), unit * g)
        nuisance, mean = both[:q], both[q:]
        if K:
            variance = np.where(varies, _variance(T, free, _left(nuisance, mean), w), LEAST)
    return Spread(nuisance, mean, variance)


def _densities(design: Design, part: np.ndarray, spread: Spread, rows: np.ndarray) -> np.ndarray:
    """Log density of the stretches `rows` (R,) [nats], up to what all probes share. part: as of `_part`."""
    T = part[rows]
    free = _free(T, design.q, spread.variance)
    square = _squares(T, free, _left(spread.nuisance, spread.mean))
    return -minus_log(square, design.logdet[rows] + free.logdet, design.size[rows])


def held_out(design: Design, places: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Log density of every stretch (stretch,) from probes and nuisances fitted without its group (stretch,)."""
    found, part = np.zeros(len(groups)), _part(design, places)
    for group in np.unique(groups):
        out, others = np.flatnonzero(groups == group), np.flatnonzero(groups != group)
        spread = _fitted(design, part, places, others if len(others) else out)
        found[out] = _densities(design, part, spread, out)
    return found


def gains(design: Design, places: np.ndarray, groups: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Held-out log density over that without probes `plain`, of every stretch (stretch,), softly cut off [nats]."""
    return np.asarray(ENOUGH_NATS * np.tanh((held_out(design, places, groups) - plain) / ENOUGH_NATS))


def sizes(design: Design, places: np.ndarray, spread: Spread) -> tuple[np.ndarray, np.ndarray]:
    """Fitted numbers of every stretch in units of the probes, (stretch, K), and their sd."""
    T, b = _part(design, places), _left(spread.nuisance, spread.mean)
    free = _free(T, design.q, spread.variance)
    w = weight(_squares(T, free, b), design.logdet + free.logdet, design.size)
    p = w / w.sum(axis=1, keepdims=True)
    c, known = _posterior(T, free, b)
    mean = np.einsum("sc,sck->sk", p, c)
    variance = np.einsum("sc,sck->sk", p, known + (c - mean[:, None]) ** 2)
    scale = np.array([design.columns[k].scale for k in places])
    return (mean + spread.mean) * scale, np.sqrt(variance) * scale


def _part(design: Design, places: np.ndarray) -> np.ndarray:
    """Products of nuisances, chosen probes and innovations, (stretch, kind, q + K + 1, q + K + 1)."""
    chosen = np.concatenate([np.arange(design.q), design.q + places, [design.gram.shape[-1] - 1]]).astype(int)
    return np.ascontiguousarray(design.gram[..., chosen[:, None], chosen[None, :]])


@dataclass(frozen=True)
class _Free:
    """Probes of unknown size, by stretch and kind. q: nuisances before them among the columns; root (K,): sd of their
    sizes. inverse (S, c, K, K): of the Cholesky factor of 1 + root P root, P the probes' products. With W, it times
    root times the probes' products with everything, T - W'W are the products within the covariance of noise and probes
    (Woodbury). logdet (S, c): what they add to the covariance's."""

    q: int
    root: np.ndarray
    inverse: np.ndarray
    logdet: np.ndarray

    def rows(self, T: np.ndarray) -> np.ndarray:
        """Of products with everything (S, c, column, ...) those of the probes, (S, c, K, ...)."""
        return T[:, :, self.q : self.q + len(self.root)]

    def reached(self, along: np.ndarray) -> np.ndarray:
        """W times a vector, (S, c, K), from what the probes' products make of it, (S, c, K)."""
        return np.asarray((self.inverse @ (self.root * along)[..., None])[..., 0])


def _free(T: np.ndarray, q: int, variance: np.ndarray) -> _Free:
    """Of products T (S, c, q + K + 1, q + K + 1) and the variances (K,) of the probes."""
    import torch

    K = len(variance)
    root = np.sqrt(variance)
    inner = T[..., q : q + K, q : q + K]
    factor = np.linalg.cholesky(np.eye(K) + root[:, None] * inner * root)
    # A triangle is inverted in a quarter of the time of any matrix, and numpy knows no triangles.
    one = torch.eye(K, dtype=torch.float64).expand(factor.shape)
    inverse = torch.linalg.solve_triangular(torch.as_tensor(factor), one, upper=False).numpy()
    logdet = 2.0 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return _Free(q, root, inverse, logdet)


def _normal(T: np.ndarray, free: _Free, w: np.ndarray) -> np.ndarray:
    """Generalised least squares of nuisances and means: products within the marginal covariance, all stretches and
    kinds in their weights w (S, c)."""
    told = w > NO_WEIGHT
    W = free.inverse[told] @ (free.root[:, None] * free.rows(T)[told])
    reached = (W * np.sqrt(w[told])[:, None, None]).reshape(-1, T.shape[-1])
    return np.asarray(np.tensordot(w, T, 2) - reached.T @ reached)


def _left(nuisance: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Innovations less what nuisances and mean probes explain, in columns of the products (q + K + 1,)."""
    return np.concatenate([-nuisance, -mean, [1.0]])


def _squares(T: np.ndarray, free: _Free, b: np.ndarray) -> np.ndarray:
    """Squares of what is left of the innovations within the covariance of noise and free probes, (S, c)."""
    along = T @ b
    return np.maximum(along @ b - np.sum(free.reached(free.rows(along)) ** 2, axis=-1), 1e-12)


def _posterior(T: np.ndarray, free: _Free, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of the probes from their mean and their variances, (S, c, K) each."""
    c = free.root * (free.reached(free.rows(T) @ b)[..., None, :] @ free.inverse)[..., 0, :]
    return c, free.root**2 * np.sum(free.inverse**2, axis=-2)


def _variance(T: np.ndarray, free: _Free, b: np.ndarray, w: np.ndarray) -> np.ndarray:
    c, known = _posterior(T, free, b)
    p = w / w.sum(axis=1, keepdims=True)
    # One interval's worth of prior at a quarter of the scale keeps few intervals from saying too much.
    total = np.einsum("sc,sck->k", w, c**2) + np.einsum("sc,sck->k", p, known) + 0.0625
    return np.clip(total / (len(w) + 1), LEAST, MOST)


def explained(design: Design, places: Sequence[int], spread: Spread) -> float:
    """Share of the squared innovations that the fitted probes take off where they were fitted, pieces weighed by how
    they err."""
    chosen = np.asarray(places, dtype=int)
    q, K = design.q, len(chosen)
    T = _part(design, chosen)
    free, left = _free(T, q, spread.variance), _left(spread.nuisance, spread.mean)
    w = weight(_squares(T, free, left), design.logdet + free.logdet, design.size)
    c, _ = _posterior(T, free, left)
    moved = np.broadcast_to(-spread.nuisance, (*w.shape, q))
    b = np.concatenate([moved, -(c + spread.mean), np.ones((*w.shape, 1))], axis=-1)
    plain = np.concatenate([-spread.nuisance, np.zeros(K), [1.0]])
    after = np.einsum("sc,sci,scij,scj->", w, b, T, b)
    before = np.einsum("sc,i,scij,j->", w, plain, T, plain)
    return float(1.0 - after / max(before, 1e-30))

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


@dataclass(frozen=True)
class Spread:
    """nuisance (q,): how far they move; mean, variance (K,): of the probes over their scales."""

    nuisance: np.ndarray
    mean: np.ndarray
    variance: np.ndarray


def fitted(design: Design, places: np.ndarray, rows: np.ndarray) -> Spread:
    """Of the probes `places` (K,) from the stretches `rows`."""
    q, K = design.q, len(places)
    varies = np.array([design.columns[k].varies for k in places], dtype=bool)
    mean, variance, nuisance = np.zeros(K), np.where(varies, 0.25, LEAST), np.zeros(q)
    T = _part(design, places)[rows]
    logdet, size = design.logdet[rows], design.size[rows]
    for _ in range(ROUNDS if K else 3):
        V, square, wider = _marginal(T, q, K, variance, nuisance, mean)
        w = weight(square, logdet + wider, size)
        # Generalised least squares of nuisances and means: products within the marginal covariance.
        H = np.einsum("sc,scij->ij", w, V[..., : q + K, : q + K])
        g = np.einsum("sc,sci->i", w, V[..., : q + K, -1])
        H[:q, :q] += design.known
        H[q:, q:] += np.eye(K)
        unit = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12))
        both = unit * np.linalg.solve(unit[:, None] * H * unit + 1e-9 * np.eye(q + K), unit * g)
        nuisance, mean = both[:q], both[q:]
        if K:
            variance = np.where(varies, _variance(T, q, K, variance, nuisance, mean, w), LEAST)
    return Spread(nuisance, mean, variance)


def densities(design: Design, places: np.ndarray, spread: Spread) -> np.ndarray:
    """Log density of every stretch, (stretch,) [nats], up to what all probes share."""
    q, K = design.q, len(places)
    T = _part(design, places)
    _, square, wider = _marginal(T, q, K, spread.variance, spread.nuisance, spread.mean)
    return -minus_log(square, design.logdet + wider, design.size)


def held_out(design: Design, places: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Log density of every stretch (stretch,) from probes and nuisances fitted without its group (stretch,)."""
    found = np.zeros(len(groups))
    for group in np.unique(groups):
        out = groups == group
        spread = fitted(design, places, np.flatnonzero(~out) if (~out).any() else np.flatnonzero(out))
        found[out] = densities(design, places, spread)[out]
    return found


def gains(design: Design, places: np.ndarray, groups: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Held-out log density over that without probes `plain`, of every stretch (stretch,), softly cut off [nats]."""
    return np.asarray(ENOUGH_NATS * np.tanh((held_out(design, places, groups) - plain) / ENOUGH_NATS))


def sizes(design: Design, places: np.ndarray, spread: Spread) -> tuple[np.ndarray, np.ndarray]:
    """Fitted numbers of every stretch in units of the probes, (stretch, K), and their sd."""
    q, K = design.q, len(places)
    T = _part(design, places)
    _, square, wider = _marginal(T, q, K, spread.variance, spread.nuisance, spread.mean)
    w = weight(square, design.logdet + wider, design.size)
    p = w / w.sum(axis=1, keepdims=True)
    c, covariance = _posterior(T, q, K, spread.variance, spread.nuisance, spread.mean)
    mean = np.einsum("sc,sck->sk", p, c)
    variance = np.einsum("sc,sckk->sk", p, covariance) + np.einsum("sc,sck->sk", p, (c - mean[:, None]) ** 2)
    scale = np.array([design.columns[k].scale for k in places])
    return (mean + spread.mean) * scale, np.sqrt(variance) * scale


def _part(design: Design, places: np.ndarray) -> np.ndarray:
    """Products of nuisances, chosen probes and innovations, (stretch, kind, q + K + 1, q + K + 1)."""
    chosen = np.concatenate([np.arange(design.q), design.q + places, [design.gram.shape[-1] - 1]]).astype(int)
    return design.gram[..., chosen[:, None], chosen[None, :]]


def _marginal(
    T: np.ndarray, q: int, K: int, variance: np.ndarray, nuisance: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Products within the covariance of noise and free probes (Woodbury), squares of what is left of the innovations,
    and what the probes add to log determinants, each by stretch and kind."""
    if not K:
        V, logdet = T, np.zeros(T.shape[:2])
    else:
        A = T[..., q : q + K]
        root = np.sqrt(variance)
        B = np.eye(K) + root[:, None] * T[..., q : q + K, q : q + K] * root
        scaled = A * root
        V = T - scaled @ np.linalg.solve(B, np.swapaxes(scaled, -1, -2))
        logdet = np.linalg.slogdet(B)[1]
    b = np.concatenate([nuisance, mean, [-1.0]])
    square = np.maximum(np.einsum("i,scij,j->sc", b, V, b), 1e-12)
    return V, square, logdet


def _posterior(
    T: np.ndarray, q: int, K: int, variance: np.ndarray, nuisance: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of the probes from their mean (stretch, kind, K), and their covariance."""
    b = np.concatenate([-nuisance, -mean, [1.0]])
    left = T[..., q : q + K, :] @ b
    covariance = np.linalg.inv(T[..., q : q + K, q : q + K] + np.diag(1.0 / variance))
    return np.einsum("scij,scj->sci", covariance, left), covariance


def _variance(
    T: np.ndarray, q: int, K: int, variance: np.ndarray, nuisance: np.ndarray, mean: np.ndarray, w: np.ndarray
) -> np.ndarray:
    c, covariance = _posterior(T, q, K, variance, nuisance, mean)
    p = w / w.sum(axis=1, keepdims=True)
    # One interval's worth of prior at a quarter of the scale keeps few intervals from saying too much.
    total = np.einsum("sc,sck->k", w, c**2) + np.einsum("sc,sckk->k", p, covariance) + 0.0625
    return np.clip(total / (len(T) + 1), LEAST, MOST)


def explained(design: Design, places: Sequence[int], spread: Spread) -> float:
    """Share of the squared innovations that the fitted probes take off where they were fitted, pieces weighed by how
    they err."""
    chosen = np.asarray(places, dtype=int)
    q, K = design.q, len(chosen)
    T = _part(design, chosen)
    _, square, wider = _marginal(T, q, K, spread.variance, spread.nuisance, spread.mean)
    w = weight(square, design.logdet + wider, design.size)
    c, _ = _posterior(T, q, K, spread.variance, spread.nuisance, spread.mean)
    moved = np.broadcast_to(-spread.nuisance, (*w.shape, q))
    b = np.concatenate([moved, -(c + spread.mean), np.ones((*w.shape, 1))], axis=-1)
    plain = np.concatenate([-spread.nuisance, np.zeros(K), [1.0]])
    after = np.einsum("sc,sci,scij,scj->", w, b, T, b)
    before = np.einsum("sc,i,scij,j->", w, plain, T, plain)
    return float(1.0 - after / max(before, 1e-30))

"""What robust weights do to covariance: the curvature that is left of a robust loss, and the scores it lets through."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.solve.loss import Loss

DIFFERENCE = 1e-5
"""Relative, of squared block norms, for the derivative of the weights."""
QUANTILES = 400


def bread_share(loss: Loss, residual: np.ndarray, block: np.ndarray) -> float:
    """Curvature of the robust cost as a share of J^T W J, on average over blocks, in (0, 1].

    A block's score w(s) r has the mean derivative w + 2 w'(s) s / d over its d directions; the second part, which the
    re-weighted normal matrix leaves out, is negative: outliers pull less the further out they are. Means are taken over
    the residuals at hand, as for any M-estimator (Huber and Ronchetti 2009, section 7.6).
    """
    _, place, count = np.unique(block, return_inverse=True, return_counts=True)
    s = np.bincount(place, weights=residual * residual, minlength=len(count))
    weight = loss.weight(s, count)
    step = DIFFERENCE * (1.0 + s)
    slope = (loss.weight(s + step, count) - loss.weight(np.maximum(s - step, 0.0), count)) / (
        s + step - np.maximum(s - step, 0.0)
    )
    kept = float(np.sum(count * weight + 2.0 * slope * s))
    return min(max(kept / float(np.sum(count * weight)), 0.05), 1.0)


def score_share(loss: Loss, block: np.ndarray) -> float:
    """Variance of the weighted residuals as a share of J^T W J under normal noise of variance 1: below 1 for robust
    losses, which cut the tails of normal noise too."""
    from scipy.special import chdtri

    size, times = np.unique(np.unique(block, return_counts=True)[1], return_counts=True)
    tail = (np.arange(QUANTILES) + 0.5) / QUANTILES
    over = under = 0.0
    for d, n in zip(size, times, strict=True):
        s = chdtri(float(d), tail)
        weight = loss.weight(s, np.full(QUANTILES, d))
        over += float(n * np.mean(weight**2 * s))
        under += float(n * d * np.mean(weight))
    return over / under

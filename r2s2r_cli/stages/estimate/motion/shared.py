"""Errors that neighbouring sightings share: what they state and do not show as scatter from frame to frame."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.prepare import Prepared, principal

REACH_S = 0.25
"""[s] Sightings that near to a frame tell its shared error."""


def shared_covariance(prepared: Prepared, factor: np.ndarray) -> np.ndarray:
    """Part of the stated covariances that smoothing does not take away [m^2], (frame, cap, 3, 3).

    factor: on the stated variances, across and along the line of sight, that gives the scatter from frame to frame (2,).
    A cap that is half behind something, or that a lamp shines on from one side, is seen beside its place in every frame
    alike: the sightings state the whole error, their scatter is what is independent, and the rest is shared. Around a
    frame the better sightings count more, as they do in the smoother; a hidden cap has that of its last or next ones.
    """
    values, axes = principal(prepared.cov)
    rest = values * np.maximum(1.0 - np.array([factor[0], factor[0], factor[1]]), 0.0)
    each = np.einsum("kci,kcia,kcib->kcab", rest, axes, axes)
    weight = prepared.sighted / np.sum(values, axis=2)
    out = np.empty_like(each)
    t = prepared.t
    first, last = np.searchsorted(t, t - REACH_S), np.searchsorted(t, t + REACH_S, side="right")
    for cap in range(each.shape[1]):
        rows = np.flatnonzero(prepared.sighted[:, cap])
        sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(weight[:, cap, None, None] * each[:, cap], axis=0)])
        counts = np.concatenate([[0.0], np.cumsum(weight[:, cap])])
        have = counts[last] - counts[first]
        near = np.flatnonzero(have > 1e-9 * counts[-1])
        mean = (sums[last] - sums[first])[near] / have[near, None, None]
        # Frames without any sighting near: the nearest one that has some.
        place = np.clip(np.searchsorted(near, np.arange(len(t))), 0, len(near) - 1)
        before = np.maximum(place - 1, 0)
        closer = np.abs(t[near[before]] - t) < np.abs(t[near[place]] - t)
        out[:, cap] = mean[np.where(closer, before, place)] if len(rows) else 0.0
    return out

"""Errors that neighbouring sightings of a cap share: what they state and do not show as scatter from frame to frame."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.prepare import Prepared, principal

TOTAL = 0.85
"""What the whole error is taken for, over what the sightings state (variances)."""
LEAST = 0.02
"""Least share of the stated variance that is shared."""


def shared_errors(prepared: Prepared, factor: np.ndarray) -> np.ndarray:
    """Shared error of one standard deviation in two directions across the line of sight [m], (frame, cap, 3, 2).

    factor: on the stated variances, across and along the line of sight, that gives the scatter between frames (2,).
    A cap that is half behind something, or lit from one side, is seen beside its place in every frame alike. Sightings
    state the whole error; their scatter is what is independent, the rest is shared. The directions are the same in all
    frames: across the mean line of sight, which is the axis along which most sightings are worst.
    """
    values, axes = principal(prepared.cov)
    across = np.sqrt(np.maximum(TOTAL - factor[0], LEAST) * 0.5 * (values[..., 0] + values[..., 1]))
    along = axes[..., 2, :][prepared.sighted]
    _, vectors = np.linalg.eigh(along.T @ along)
    return np.where(prepared.sighted, across, 0.0)[..., None, None] * vectors[:, :2]

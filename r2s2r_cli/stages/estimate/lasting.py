"""Errors of a tracker that last from frame to frame, seen in the lengths of its rods.

Noise is measured from how caps scatter about their motion over a few frames (`stages/frames.py`), and an error that
lasts longer than that goes with the motion: an AR(1) error of 10 mm with 0.7 from frame to frame scatters by 5.5 mm.
But a rod does not change its length. Whatever its seen length does is the tracker's error, however slow.
"""

from __future__ import annotations

import numpy as np

LONGEST_S = 1.0
"""Longer errors are offsets: of a camera's scale, a pose, a pair of caps seen too near. They are no noise."""
LEAST = 0.25
"""Correlation below which lags are noise of the estimate."""
LEAST_FRAMES = 60
"""Fewer say too little of a correlation."""
_MAD = 0.6745
"""Median of |x| of a standard normal number."""


def lasting(t: np.ndarray, p_WE: np.ndarray, noise_sd: np.ndarray) -> float:
    """By how much white noise must be larger than `noise_sd` to say as little of the caps as this tracker's errors do.

    t: stamps [s], (frame,). p_WE: observed caps of rods whose length the source left free [m], (frame, cap, 3), in
    pairs. noise_sd: per cap and axis [m], (cap, 3). 1 where errors do not last, or nothing can be said.

    The sum of the correlations of all lags is the white noise of the same spectrum at rest (Bartlett); it ends at the
    first lag that is not correlated any more, at LONGEST_S at most. Differences, not products: slow changes of a length
    drop out, and their medians, as caps are exchanged now and then.
    """
    if len(t) < LEAST_FRAMES:
        return 1.0
    bar = p_WE[:, 1::2] - p_WE[:, 0::2]
    length = np.linalg.norm(bar, axis=-1)
    axis = bar / length[..., None]
    stated = float(np.mean(np.sum(axis**2 * (noise_sd[0::2] ** 2 + noise_sd[1::2] ** 2), axis=-1)))
    most = min(round(LONGEST_S / float(np.median(np.diff(t)))), len(t) // 3)
    if most < 2:
        return 1.0
    scatter = np.array([_variance(length[lag:] - length[:-lag]) / 2.0 for lag in range(1, most + 1)])
    whole = float(np.median(scatter[most // 2 :]))
    correlation = 1.0 - scatter / whole
    ends = np.flatnonzero(correlation < LEAST)
    together = float(correlation[: ends[0] if len(ends) else most].sum())
    if together <= 0.0:
        return 1.0
    return float(max(1.0, np.sqrt(whole * (1.0 + 2.0 * together) / stated)))


def _variance(values: np.ndarray) -> float:
    return float((np.median(np.abs(values)) / _MAD) ** 2)

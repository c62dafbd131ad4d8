"""Which caps carry weight, from heights: two states a cap that follow each other in time (a hidden Markov model)."""

from __future__ import annotations

import numpy as np

STEADY_S = 1.5
"""[s] How long a cap usually stays on or off the floor."""
GIVE_M = 7e-4
"""[m] By how much the heights of caps that carry weight differ, errors that neighbouring frames share included."""
REACH_M = 0.03
"""[m] How high a cap off the floor usually is."""
ALIKE_S = 0.077
"""[s] How long smoothed heights err alike: of the evidence of a frame so much is its own as lies in the gap before it
(0.35 of it at 30 frames a second, 0.73 at ten)."""


def touching_probability(t: np.ndarray, height: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Probability that a cap carries weight, shape (frame, cap).

    t: [s], (frame,). height: of the lowest point above the floor [m], sd: its standard deviation [m], (frame, cap).
    On the floor heights scatter about 0; off it they are anywhere up to some REACH_M. Forward and backward messages
    of the two states carry what is known through frames in which a cap is hidden.
    """
    from scipy.special import log_ndtr

    spread = np.hypot(sd, GIVE_M)
    on = -0.5 * (height / spread) ** 2 - np.log(spread * np.sqrt(2 * np.pi))
    # Exponential heights with Gaussian errors.
    off = -height / REACH_M + 0.5 * (sd / REACH_M) ** 2 - np.log(REACH_M) + log_ndtr(height / sd - sd / REACH_M)
    gap = np.diff(t)
    own = 1.0 - np.exp(-np.concatenate([gap[:1], gap]) / ALIKE_S) if len(gap) else np.ones(1)
    odds = np.clip(own[:, None] * (on - off), -30.0, 30.0)
    stay = 0.5 * (1.0 + np.exp(-2.0 * np.diff(t) / STEADY_S))
    ahead, back = np.zeros_like(odds), np.zeros_like(odds)
    for k in range(1, len(t)):
        ahead[k] = _pass_on(ahead[k - 1] + odds[k - 1], stay[k - 1])
    for k in range(len(t) - 2, -1, -1):
        back[k] = _pass_on(back[k + 1] + odds[k + 1], stay[k])
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(ahead + back + odds, -500, 500))))


def _pass_on(odds: np.ndarray, stay: float) -> np.ndarray:
    """Log odds after a gap in which the state is kept with probability `stay`."""
    p = 1.0 / (1.0 + np.exp(-np.clip(odds, -500, 500)))
    p = p * stay + (1 - p) * (1 - stay)
    p = np.clip(p, 1e-12, 1 - 1e-12)
    return np.asarray(np.log(p) - np.log1p(-p))

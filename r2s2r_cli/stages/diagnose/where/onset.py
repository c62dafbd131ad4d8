"""Whether the gap begins with an interval: what speaks for a probe before it and from it on."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.where.found import Onset, SegmentGap

DRAWS = 999
LEVEL = 0.02
QUIET = 0.3
"""Before the beginning the gap is at most this share of what it is afterwards."""


def onset(segments: tuple[SegmentGap, ...], gain: np.ndarray, seed: int) -> Onset | None:
    """None where the gap is there from the first interval on, or nowhere, or no order of intervals is unusual.

    gain: log density of every interval with the best probe over that without, (stretch,) [nats]. The interval is that
    of the largest cumulative sum (Page 1954); the chance is that of one as large in intervals in another order.
    """
    if len(gain) < 4 or np.ptp(gain) == 0:
        return None
    steps = _steps(gain[None])[0]
    place = int(np.argmax(steps)) + 1
    rng = np.random.default_rng(seed)
    drawn = _steps(rng.permuted(np.tile(gain, (DRAWS, 1)), axis=1)).max(axis=1)
    p = float((1 + np.sum(drawn >= steps.max())) / (DRAWS + 1))
    before, after = float(gain[:place].mean()), float(gain[place:].mean())
    if p > LEVEL or before > QUIET * after:
        return None
    one = segments[place]
    return Onset(one.order, one.run, one.interval, (after - max(before, 0.0)) * (len(gain) - place), p)


def _steps(gain: np.ndarray) -> np.ndarray:
    """Standardised steps up of the mean of gains (draw, n) before each interval but the first, (draw, n - 1)."""
    n = gain.shape[1]
    k = np.arange(1, n)
    after = np.cumsum(gain[:, ::-1], axis=1)[:, ::-1][:, 1:]
    before = gain.sum(axis=1, keepdims=True) - after
    return np.asarray((after / (n - k) - before / k) * np.sqrt(k * (n - k) / n))

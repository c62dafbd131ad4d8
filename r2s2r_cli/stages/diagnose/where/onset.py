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
    found, place = _best(gain)
    rng = np.random.default_rng(seed)
    drawn = np.array([_best(rng.permutation(gain))[0] for _ in range(DRAWS)])
    p = float((1 + np.sum(drawn >= found)) / (DRAWS + 1))
    before, after = float(gain[:place].mean()), float(gain[place:].mean())
    if p > LEVEL or before > QUIET * after:
        return None
    one = segments[place]
    return Onset(one.order, one.run, one.interval, (after - max(before, 0.0)) * (len(gain) - place), p)


def _best(gain: np.ndarray) -> tuple[float, int]:
    """Largest standardised step up of the mean, and the first interval after it."""
    n = len(gain)
    k = np.arange(1, n)
    after = np.cumsum(gain[::-1])[::-1][1:]
    step = (after / (n - k) - (gain.sum() - after) / k) * np.sqrt(k * (n - k) / n)
    place = int(np.argmax(step))
    return float(step[place]), place + 1

"""Whether the gap begins with an interval: what speaks for a probe before it and from it on."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.where.found import Onset, SegmentGap

DRAWS = 999
LEAST_NATS = 6.0
"""A beginning must be worth so much more than a gap that is always there."""
LEVEL = 0.05


def onset(segments: tuple[SegmentGap, ...], gain: np.ndarray, seed: int) -> Onset | None:
    """None where the gap is there from the first interval on, or nowhere, or no order of intervals is unusual.

    gain: log density of every interval with the best probe over that without, (stretch,) [nats]. The chance is that of
    as large a gain in intervals whose order was drawn anew.
    """
    if len(gain) < 4:
        return None
    found, place = _best(gain)
    rng = np.random.default_rng(seed)
    drawn = np.array([_best(rng.permutation(gain))[0] for _ in range(DRAWS)])
    p = float((1 + np.sum(drawn >= found)) / (DRAWS + 1))
    if place == 0 or found < LEAST_NATS or p > LEVEL:
        return None
    one = segments[place]
    return Onset(one.order, one.run, one.interval, float(found), p)


def _best(gain: np.ndarray) -> tuple[float, int]:
    """Gain of the best beginning over the better of none and always, and where it is."""
    after = np.cumsum(gain[::-1])[::-1]
    place = int(np.argmax(after))
    return float(after[place] - max(after[0], 0.0)), place

"""What a fitted number is worth: one share decides its label, its reason, and whether an interval is printed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.trust.covariance import Covariance
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust, left_of, trust_of
from r2s2r_cli.stages.identify.trust.words import shrunk

FEW_WINDOWS = 1.5
"""Quantile of Student's t over that of a normal distribution beyond which the interval is wide because windows are few:
three degrees of freedom or fewer."""
_NORMAL_95 = 1.959964
_NOT_SEEN = "no compared frame depends on it"
_BY_CHANGE = " (by a finite change: the derivative here is that of a kink)"


def worth(after: Identifiability, spread: Covariance, frees: Sequence[Free]) -> tuple[tuple[Trust, str], ...]:
    """Trust and reason of each parameter after a fit.

    Counted is the share of the width of prior and bounds that is left: by the information at the solution, or by the
    reported interval (95 %), whichever leaves more. The interval knows what the information does not: windows that
    disagree, and that few of them tell little. An interval that reaches both bounds leaves more than 0.88. One window
    alone knows of no disagreement, so that its intervals are of noise only: nothing is identified by it.
    """
    reported = spread.sd_z * spread.quantile / _NORMAL_95 / after.width
    reported = np.where(np.isfinite(reported), reported, 1.0)
    shares = np.maximum(left_of(after.sd_z), reported)
    found = []
    for k, (free, share) in enumerate(zip(frees, shares.tolist(), strict=True)):
        if free.name in after.no_effect:
            found.append((Trust.NOT_IDENTIFIABLE, _NOT_SEEN))
            continue
        reason = shrunk(free, float(after.width[k]), share)
        if spread.quantile[k] > FEW_WINDOWS * _NORMAL_95 and reported[k] >= left_of(after.sd_z)[k]:
            reason += f": {spread.clusters} windows are too few to say more" if spread.clusters else ": too few windows"
        elif free.name in (*after.stalled, *after.rough):
            reason += _BY_CHANGE
        trust = trust_of(share)
        if spread.clusters < 2 and trust is Trust.IDENTIFIED:
            trust, reason = Trust.WEAK, f"{reason}, but by one interval alone: nothing shows what others would say"
        found.append((trust, reason))
    return tuple(found)

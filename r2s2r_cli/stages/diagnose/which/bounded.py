"""What counts of what pieces say: no hypothesis loses more than a little at a piece against the best of them all.

A robot that tips over at another instant than its simulator is explained by anything: whichever of thirty hypotheses
happens to fall with it gains 10 to 50 nats at that piece, in sets with nothing wrong as in others. What is really there
shows wherever it acts, so that many pieces decide, not one or two.
"""

from __future__ import annotations

import numpy as np

ENOUGH = 6.0
"""[nats]"""
ENOUGH_OF_TWO = 12.0
"""[nats] The same where a second effect joins a first one: what that leaves shows at fewer pieces."""


def bounded(table: np.ndarray, enough: float = ENOUGH) -> np.ndarray:
    """Log densities (hypothesis, piece) [nats] with losses against the best of every piece bounded."""
    return np.asarray(np.logaddexp(table, table.max(axis=0) - enough))


def gains_over_first(table: np.ndarray, enough: float = ENOUGH) -> np.ndarray:
    """Of all hypotheses but the first over the first one, (hypothesis - 1,) [nats]."""
    total = bounded(table, enough).sum(axis=1)
    return np.asarray(total[1:] - total[0])


def over_first(table: np.ndarray, enough: float = ENOUGH) -> np.ndarray:
    """The same piece by piece, (hypothesis - 1, piece) [nats]; 0 at one where all of them break off."""
    own = bounded(table, enough)
    known = np.isfinite(own[0])
    return np.where(known, own[1:], 0.0) - np.where(known, own[0], 0.0)

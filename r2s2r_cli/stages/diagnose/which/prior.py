"""What it costs that nuisances are not where they were known to be."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit


def strain(arena: Arena, fit: Fit) -> float:
    """What it costs that the nuisances of a fit that all runs share are not where they were known to be [nats]: where
    no effect that is fitted is the cause, they make up for it."""
    n = arena.shared
    away = (fit.z - arena.mean)[:n]
    return float(0.5 * away @ arena.precision[:n, :n] @ away)


def unlikely(arena: Arena, z: np.ndarray) -> np.ndarray:
    """-log prior density of nuisances z (k, p + q), up to a constant, (k,) [nats]."""
    away = z - arena.mean
    return np.asarray(0.5 * np.einsum("ki,ij,kj->k", away, arena.precision, away))

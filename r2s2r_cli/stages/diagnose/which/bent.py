"""What straight lines do not tell of starts and nuisances: simulated at draws of what is known of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.starting import LOST_M, clipped

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.which.arena import Arena

DRAWS = 6
"""Of starts and nuisances together."""


def bent(arena: Arena, z: np.ndarray, seen: Sequence[Seen]) -> list[np.ndarray]:
    """What offsets change of every stretch, (offset + draw, channel, F): along straight lines, and what draws are off
    these; the ends of stretches are roughened alike. arena: white along straight lines; seen: at nuisances z (p + q,)
    from the starts themselves (and others)."""
    rng = np.random.default_rng(0)
    starting, J = arena.starting, arena.by_nuisance
    rows = slice(0, arena.white[-1].kinds[0].rows.stop)
    H = J[rows].T @ J[rows] + arena.precision
    p = len(arena.engine)
    value, vector = np.linalg.eigh(np.linalg.inv(H)[:p, :p])
    root = vector * np.sqrt(np.maximum(value, 0.0))
    points = np.repeat(z[None], DRAWS, axis=0)
    points[:, :p] = np.clip(z[:p] + rng.standard_normal((DRAWS, p)) @ root.T, arena.lower[:p], arena.upper[:p])
    by = [rng.standard_normal((DRAWS, starting.offsets)) @ white.kinds[0].spread for white in arena.white]
    far = [one * own for one, own in zip(by, starting.known, strict=True)]
    there = arena.replayer.around(arena.many, arena.values(points), far)
    found = []
    along = [(points[:, :p] - z[:p]) @ one for one in arena.by_engine]
    for k, (one, here) in enumerate(zip(there, seen, strict=True)):
        first = Seen(here.caps[:1], here.length[:1], here.begin[:1], here.end[:1])
        change = clipped(arena.residual(k, one, points)) - clipped(arena.residual(k, first, z[None]))
        change -= np.einsum("ko,ocf->kcf", by[k], starting.by_start[k]) + arena.white[k].residual(along[k])
        found.append(np.clip(change, -LOST_M, LOST_M) / np.sqrt(DRAWS))
    for k, j in enumerate(starting.before):
        if j is not None:
            ends = starting.ahead(k, there[k], there[j], by[k], by[j]) - starting.ahead(k, seen[k], seen[j])[:1]
            starting.roughen(k, ends - arena.white[k].ahead(along[k]))
    return [np.concatenate(both) for both in zip(starting.by_start, found, strict=True)]

"""Two effects at once: which ones are tried beside the best, and fits of them together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.screen import Response
from r2s2r_cli.stages.diagnose.which.search import Said, best_of

PAIRED, BESIDE = 5, 2
"""Effects that are tried beside the best one: those that explain most of what it leaves, and the next best alone."""
ITERATIONS = 4
KEPT = 3
"""Pairs that are scored."""
SAID_MOST = 20.0
"""[nats] that the parity stage counts for a partner: what the replay says of it shall not be outvoted altogether."""


def pairs_of(
    arena: Arena, base: Fit, fits: Sequence[Fit], gained: np.ndarray, responses: Sequence[Response], told_by: Said
) -> list[Fit]:
    """The best single effect with those that explain most of what it leaves. gained (fit,): by each [nats]; responses:
    of the screening; told_by: what the parity stage says, which speaks for causes one by one. Best first."""
    if len(fits) < 2:
        return []
    order = np.argsort(-gained, kind="stable")
    first = fits[order[0]]
    fitted: dict[str, Fit] = {}
    for i in order[1:]:
        fitted.setdefault(fits[i].hypothesis.effects[0], fits[i])
    fits_of = Fits(arena)
    points = []
    tried = partners(fits_of, first, responses, told_by)
    alone = [name for name in fitted if name not in first.hypothesis.effects][:BESIDE]
    for response in [*tried[:PAIRED], *(one for one in tried[PAIRED:] if one.candidate.effect in alone)]:
        known = fitted.get(response.candidate.effect)
        part = response.candidate if known is None else known.hypothesis.parts[0]
        x, z = (response.size, response.start_z) if known is None else (known.x, known.z)
        both = Hypothesis((*first.hypothesis.parts, part))
        points.append((both, np.clip(first.z + z - base.z, arena.lower, arena.upper), np.concatenate([first.x, x])))
        points.append((both, first.z, np.concatenate([first.x, 0.5 * (x + part.off)])))
    begun = fits_of.begun(points, [first.away] * len(points))
    fits_of.run(begun, iterations=ITERATIONS)
    return best_of(begun)[:KEPT]


def partners(fits: Fits, first: Fit, responses: Sequence[Response], told_by: Said) -> list[Response]:
    """The best element of every other effect, in the order of what it would explain of what `first` leaves. Alone an
    effect may explain nothing that a larger one does not; beside that one it is judged by what is left."""
    likely = fits.likely(first)
    taken, _ = np.linalg.qr(likely[:, None] * first.jacobian)
    rest = likely * first.residual
    best: dict[str, tuple[float, Response]] = {}
    for one in responses:
        name = one.candidate.effect
        if not one.testable or name in first.hypothesis.effects:
            continue
        own = one.direction - taken @ (taken.T @ one.direction)
        # A direction of unit length, its size at most a few times what was tried.
        size2 = max(one.seen**2 * (1.0 - one.absorbed), 1e-9)
        gain = 0.5 * float(own @ rest) ** 2 / (float(own @ own) + 1.0 / size2)
        gain += min(told_by.get(name, {}).get(one.candidate.number, 0.0), SAID_MOST)
        if name not in best or gain > best[name][0]:
            best[name] = (gain, one)
    return [one for _, one in sorted(best.values(), key=lambda found: -found[0])]

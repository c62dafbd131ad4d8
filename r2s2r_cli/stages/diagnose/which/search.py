"""Which candidates are fitted, and how far: many from where the screening left them, fewer of them further."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.candidates import Candidate
from r2s2r_cli.stages.diagnose.which.fit import LEAST_GAIN, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import DAMPING, Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.screen import Response

WIDE = 32
"""Candidates that are looked into."""
TWICE = 26
"""Of them, from two starts."""
ELEMENTS = 2
"""Of an effect, at most."""
ROUNDS = ((2, 16), (2, 8))
"""Iterations, and fits that go on after them."""
LAST = 4
"""Iterations of those that are left."""
AGAIN, BETWEEN = 3, 2
"""Times that these show each other their nuisances and starts, and iterations after each."""
LED, LED_ON = 4, 4
"""Fits from whose nuisances and starts the refit nominal model is tried again, and its iterations there."""
GIVING = 6
"""Fits whose nuisances and starts all are tried with."""
OTHERS = (5.0, 2.0, 0.5)
"""Shares of its size that a fit is tried at as well after each round, beside the nuisances of others."""
SUSPECTED, LEAST_SAID = 3, 2.0
"""Effects that are fitted because the parity stage speaks for them, with so many nats at least."""

Told = Callable[[str, int, int], None]
Said = Mapping[str, Mapping[int | None, float]]
"""Nats of the parity stage, by effect and element (`Parity.nats`)."""


def picked_of(responses: Sequence[Response], told_by: Said) -> list[Response]:
    """What is looked into: the best element of every effect, those that the parity stage speaks for, and then the best
    of the others, ELEMENTS of an effect at most."""
    testable = [one for one in responses if one.testable]
    best = list(dict.fromkeys(one.candidate.effect for one in testable))
    own = {name: [one for one in testable if one.candidate.effect == name] for name in best}
    found = [max(own[name], key=lambda one: told_by[name].get(one.candidate.number, 0.0))
             for name in _suspected(best, told_by)]  # fmt: skip
    found += [own[name][0] for name in best]
    found += testable
    kept: dict[int, Response] = {}
    count: dict[str, int] = {}
    for one in found:
        name = one.candidate.effect
        if id(one) not in kept and count.get(name, 0) < ELEMENTS and len(kept) < WIDE:
            kept[id(one)] = one
            count[name] = count.get(name, 0) + 1
    return list(kept.values())


def fitted(arena: Arena, base: Fit, picked: Sequence[Response], told_by: Said, told: Told) -> tuple[Fit, list[Fit]]:
    """The refit nominal model and fits of the picked candidates, all from the same start: else who goes on gains what
    the other left. What has gained least after a few iterations goes no further. Best first."""
    fits = Fits(arena)
    points: list[tuple[Hypothesis, np.ndarray, np.ndarray]] = [(Hypothesis(), base.z, base.x)]
    points += [(Hypothesis((one.candidate,)), one.start_z, one.size) for one in picked]
    # The refit nominal model has made up for what is wrong: the same from what the numbers were before, and larger.
    was = np.where(np.arange(len(base.z)) < arena.shared, np.clip(arena.mean, arena.lower, arena.upper), base.z)
    points += [(Hypothesis((one.candidate,)), was, one.tried) for one in picked[:TWICE]]
    points += [(Hypothesis((own,)), was, own.tries[0]) for own in _said(picked, told_by)]
    nominal, *going = fits.begun(points)
    told("fits", 0, len(ROUNDS) + 1)
    fits.settle([nominal, *going])
    for number, (iterations, kept) in enumerate(ROUNDS):
        fits.run([nominal, *going], iterations=iterations)
        going = _kept(best_of(going), told_by, kept)
        nominal, *going = exchanged(fits, [nominal, *going], others=OTHERS)
        told("fits", number + 1, len(ROUNDS) + 1)
    fits.run([nominal, *going], iterations=LAST)
    nominal = led(fits, nominal, best_of(going)[:LED], iterations=LED_ON)
    for _ in range(AGAIN):
        nominal, *going = exchanged(fits, [nominal, *best_of(going)])
        fits.run([nominal, *going], iterations=BETWEEN)
    told("fits", len(ROUNDS) + 1, len(ROUNDS) + 1)
    return nominal, best_of(going)


def exchanged(fits: Fits, found: Sequence[Fit], *, others: Sequence[float] = ()) -> list[Fit]:
    """The fits, best first, each with the nuisances and starts of whichever of the first GIVING serves it best. Costs
    are rough: one that has found a better place shows it to the others, the refit nominal model above all, else
    everything gains against it. others: shares of its size that an effect is tried at as well. Where nuisances have
    made up for most of an effect they hold its fit at what they left of it, and no small step leads out of there; at
    five times the size beside the nuisances of a fit that is not held so, one does."""
    points: list[tuple[Hypothesis, np.ndarray, np.ndarray]] = []
    away: list[np.ndarray] = []
    of: dict[int, list[int]] = {}
    for i, one in enumerate(found):
        sizes = (one.x, *_other_sizes(one, others))
        for other in (*found[:GIVING], *(() if i < GIVING else (one,))):
            for size in sizes:
                if other is not one or size is not one.x:
                    of.setdefault(i, []).append(len(points))
                    points.append((one.hypothesis, other.z, size))
                    away.append(other.away)
    costs = fits.costs(points, away) if points else np.zeros(0)  # the refit nominal model alone has nobody to show it
    best = {i: min(rows, key=lambda k: costs[k]) for i, rows in of.items()}
    moved = [i for i, k in best.items() if costs[k] < found[i].cost - LEAST_GAIN]
    begun = fits.begun([points[best[i]] for i in moved], [away[best[i]] for i in moved])
    new = dict(zip(moved, begun, strict=True))
    for one in (*found, *begun):
        one.ended, one.damping = False, DAMPING
    for i, one in new.items():
        one.start = found[i].start
    return [new.get(i, one) for i, one in enumerate(found)]


def _other_sizes(one: Fit, shares: Sequence[float]) -> list[np.ndarray]:
    """Shares of the fit's size, within its bounds; none for the refit nominal model."""
    parts = one.hypothesis.parts
    if not parts:
        return []
    edges = np.cumsum([len(part.off) for part in parts])[:-1]
    own = np.split(one.x, edges)
    sizes = [np.concatenate([part.share(x, share) for part, x in zip(parts, own, strict=True)]) for share in shares]
    inside = [np.clip(size, one.hypothesis.stack("lower"), one.hypothesis.stack("upper")) for size in sizes]
    return [size for size in inside if not np.allclose(size, one.x)]


def led(fits: Fits, one: Fit, by: Sequence[Fit], *, iterations: int) -> Fit:
    """The fit, or where it comes to from the nuisances and starts of fits that have an effect more, if that is better.
    An effect that only led them out of a hollow would else keep what they gain."""
    points = [(one.hypothesis, other.z, other.x[: len(one.x)]) for other in by]
    tried = fits.begun(points, [other.away for other in by])
    fits.settle(tried)
    fits.run(tried, iterations=iterations)
    best = min([one, *tried], key=lambda fit: fit.cost)
    best.start = one.start
    return best


def _suspected(names: Sequence[str], told_by: Said) -> list[str]:
    """Of these effects, better ones first, those that the parity stage speaks for most; of such as it speaks for alike
    the better ones."""
    said = {name: max(told_by.get(name, {None: 0.0}).values()) for name in names}
    return sorted((name for name in names if said[name] >= LEAST_SAID), key=lambda name: -said[name])[:SUSPECTED]


def _said(picked: Sequence[Response], told_by: Said) -> list[Candidate]:
    """Candidates that the parity stage speaks for: their first tries are at the sizes that it says."""
    return [
        one.candidate for one in picked
        if told_by.get(one.candidate.effect, {}).get(one.candidate.number, 0.0) >= LEAST_SAID
        and len(one.candidate.tries)
    ]  # fmt: skip


def _kept(fits: Sequence[Fit], told_by: Said, count: int) -> list[Fit]:
    """The first fits, and those of the effects that the parity stage speaks for most."""
    names = list(dict.fromkeys(fit.hypothesis.effects[0] for fit in fits))
    also = {next(id(fit) for fit in fits if fit.hypothesis.effects[0] == name) for name in _suspected(names, told_by)}
    return [fit for k, fit in enumerate(fits) if k < count or id(fit) in also]


def best_of(fits: Sequence[Fit]) -> list[Fit]:
    """Of every hypothesis the fit of least cost, best first."""
    best: dict[str, Fit] = {}
    for fit in fits:
        label = fit.hypothesis.label
        if label not in best or fit.cost < best[label].cost:
            best[label] = fit
    return sorted(best.values(), key=lambda fit: fit.cost)

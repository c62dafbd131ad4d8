"""Stage 2 of a diagnosis: which effect. Refit nominal + effect against refit nominal: on all data together, which rank
effects for the larger part, and on gaits that were left out, which doubt and say what a claim is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.stranger import Stranger
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy, chronic
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.found import Which
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.left import expected, left
from r2s2r_cli.stages.diagnose.which.marginal import marginal_gains
from r2s2r_cli.stages.diagnose.which.material import Material
from r2s2r_cli.stages.diagnose.which.pairs import ITERATIONS, pairs_of
from r2s2r_cli.stages.diagnose.which.rivals import WIDER, chance, no_gap
from r2s2r_cli.stages.diagnose.which.score import Score, groups_of, scores
from r2s2r_cli.stages.diagnose.which.screen import screen
from r2s2r_cli.stages.diagnose.which.search import Said, Told, fitted, led, picked_of
from r2s2r_cli.stages.diagnose.which.verdict import concluded

PLACES = 8
"""Of a patch on the floor, to begin with."""
MOST_UNEXPLAINED = 12.0
"""[nats] that a piece says for a wider floor."""
LOOKED_AT = 4
"""Fits that the size of an error without a name is learned from."""
SECOND = 3
"""Iterations after the floor was widened."""


@dataclass(frozen=True)
class Compared:
    """What the later stages go on from: the arena, the refit nominal model, the fits in the order of the ranking, their
    scores."""

    arena: Arena
    base: Fit
    fits: tuple[Fit, ...]
    refit: Score
    scores: tuple[Score, ...]
    which: Which


def compare_effects(
    arena: Arena, base: Fit, *, floor_m: float, kept: float = 1.0, calibration: Calibration,
    sizes: Mapping[str, Mapping[str, float]], told_by: Said | None = None,
    effects: Sequence[str] | None = None, seed: int = 0, told: Told,
    strangers: bool = True, healthy: Healthy | None = None, stranger: Stranger | None = None,
) -> Compared:  # fmt: skip
    """All effects against the refit nominal model `base` of this arena. floor_m: key-frame RMSE with nothing wrong, of
    the share `kept` of the intervals.
    healthy: the runs of before; an effect that helps there as well makes up for the simulator.

    sizes, told_by: of the parity stage: sizes to begin with, and the nats that it says for an effect at an element: the
    first SUSPECTED are fitted whatever the screening says. effects: only these. strangers: an error without a name is
    possible; False in an ablation. stranger: what the logs show that no effect has. Raises NumericalError where nothing
    can be simulated.
    """
    calibration = calibration if healthy is not None else calibration.absolute()
    made = candidates(arena.model, sizes, touched(arena), arena.values(base.z[None])[0])
    known = [one for one in made if effects is None or one.effect in effects]
    told("screening", 0, 1)
    responses = screen(arena, base, known)
    told("screening", 1, 1)
    groups = groups_of(arena)
    picked = picked_of(responses, told_by or {})
    base, fits = fitted(arena, base, picked, told_by or {}, told)
    at_least = expected(arena)
    wider, unexplained = _widened(arena, [base, *fits[:LOOKED_AT]]) if strangers else (1.0, -np.inf)
    if wider > 1.0:
        arena.whiten(floor_m=wider * arena.floor_m)
        base, *fits = _again(arena, [base, *fits])
        # Directions of the screening were white under the floor of before, and its nuisances began where the base was.
        responses = screen(arena, base, known)
    told("left out", 0, 1)
    # Where a fit came by a cliff, and went on in small steps, its derivative is still that of the cliff.
    Fits(arena).secants(fits)
    refit, *own = scores(arena, [base, *fits], groups)
    old = chronic(arena, healthy, fits)
    by_chance = chance(arena, responses, groups, seed=seed)
    said = marginal_gains(arena, base, fits).less(old)
    # Beside an effect that gains no more than chance does even left out, a second one is no second cause.
    likely = said.counted.max(initial=0.0) > by_chance
    pairs = pairs_of(arena, base, fits, said.counted, responses, told_by or {}) if likely else []
    if pairs:
        first = int(said.counted.argmax())
        alone = led(Fits(arena), fits[first], pairs, iterations=ITERATIONS)
        if alone is not fits[first]:
            fits[first], own[first] = alone, scores(arena, [alone], groups)[0]
            old[first] = chronic(arena, healthy, [alone])[0]
            said = marginal_gains(arena, base, fits).less(old)
        Fits(arena).secants(pairs)
        own = [*own, *scores(arena, pairs, groups)]
        before = chronic(arena, healthy, pairs)
        said = said.with_pairs(first, marginal_gains(arena, base, pairs).whole - before)
        fits, old = [*fits, *pairs], np.concatenate([old, before])
    told("left out", 1, 1)
    material = Material(
        arena=arena, base=base, refit=refit, fits=tuple(fits), scores=tuple(own), responses=responses,
        chance=by_chance, no_gap=no_gap(refit, floor_m, kept=kept), wider=wider,
        left=left(at_least, arena.sizes, refit, own, healthy),
        unexplained=unexplained, groups=groups, calibration=calibration, chronic=old, marginal=said.counted,
        whole=said.whole,
        asked=None if effects is None else tuple(effects), parity=told_by or {},
        stranger=stranger if strangers else None,
    )  # fmt: skip
    which = concluded(material)
    order = _in_order(which, fits, said.counted)
    return Compared(arena, base, tuple(fits[i] for i in order), refit, tuple(own[i] for i in order), which)


def _in_order(which: Which, fits: Sequence[Fit], said: np.ndarray) -> list[int]:
    """Places of the fits: what is committed to, then as the ranking has it with its elements, two effects after the
    better of them."""
    place = {one.effect: k for k, one in enumerate(which.ranking)}
    seats = {one.effect: one.element for one in which.ranking}

    def key(i: int) -> tuple[bool, int, int, bool, float]:
        parts, own = fits[i].hypothesis.parts, fits[i].hypothesis.effects
        elsewhere = any(one.element not in (None, seats[one.effect]) for one in parts)
        return own != which.effects, min(place[name] for name in own), len(own), elsewhere, -float(said[i])

    return sorted(range(len(fits)), key=key)


def touched(arena: Arena) -> np.ndarray:
    """Places (n, 2) [m] where caps stood on the ground, far from each other, PLACES at most."""
    seen = []
    for one in arena.many:
        for frame in one.caps[[0, -1]]:
            seen.append(frame[np.argsort(frame[:, 2])[:3], :2])
    points = np.concatenate(seen)
    kept = [points[0]]
    while len(kept) < min(PLACES, len(points)):
        away = np.min(np.linalg.norm(points[:, None] - np.array(kept)[None], axis=-1), axis=1)
        kept.append(points[int(np.argmax(away))])
    return np.array(kept)


def _widened(arena: Arena, fits: Sequence[Fit]) -> tuple[float, float]:
    """By how much the floor must grow to explain what the best of some fits leaves, and what that gains [nats]."""
    own = arena.floor_m
    raws = [[one[None] for one in fit.raw] for fit in fits]
    found: dict[float, np.ndarray] = {}
    for factor in (1.0, *WIDER):
        arena.whiten(floor_m=factor * own, trial=True)
        found[factor] = np.array([arena.log_densities(raw) for raw in raws]).max(axis=0)
    arena.whiten(floor_m=own)
    more = {factor: float(np.minimum(one - found[1.0], MOST_UNEXPLAINED).sum()) for factor, one in found.items()}
    factor = max(more, key=lambda one: more[one])
    return factor, more[factor]


def _again(arena: Arena, old: Sequence[Fit]) -> list[Fit]:
    """The fits with the arena's new covariance, each from where it was."""
    fits = Fits(arena)
    begun = fits.begun([(fit.hypothesis, fit.z, fit.x) for fit in old], [fit.away for fit in old])
    for new, fit in zip(begun, old, strict=True):
        new.start = fit.start
    fits.run(begun, iterations=SECOND)
    return begun

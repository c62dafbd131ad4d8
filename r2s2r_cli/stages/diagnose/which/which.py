"""Stage 2 of a diagnosis: which effect. Refit nominal + effect against refit nominal, on gaits that were left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy, chronic
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.fit import DAMPING, Fit, Fits, Hypothesis
from r2s2r_cli.stages.diagnose.which.found import Which
from r2s2r_cli.stages.diagnose.which.left import expected, left
from r2s2r_cli.stages.diagnose.which.linear import by_element, linear_gains
from r2s2r_cli.stages.diagnose.which.material import Material
from r2s2r_cli.stages.diagnose.which.rivals import WIDER, chance, no_gap
from r2s2r_cli.stages.diagnose.which.score import ENOUGH, Score, gains, groups_of, scores
from r2s2r_cli.stages.diagnose.which.screen import Response, screen
from r2s2r_cli.stages.diagnose.which.verdict import concluded

FITTED = 6
"""Effects that are fitted, of those with the highest linear gains."""
ELEMENTS = 2
"""Elements of each that are fitted."""
LOOKED_INTO = 3
"""Elements of each of which linear gains are computed, the best of the screening."""
SUSPECTED, LEAST_SAID = 3, 2.0
"""Effects that are fitted because the parity stage speaks for them, with so many nats at least."""
PLACES = 8
"""Of a patch on the floor, to begin with."""
LOOKED_AT = 4
"""Fits that the size of an error without a name is learned from."""
FIRST = 2
"""Iterations of all starts of a hypothesis; the best one goes on."""
POLISHED = 3
"""Fits that go on when all have ended."""
PAIRED = 5
"""Effects that are tried beside the best one."""
SECOND = 3
"""Iterations after the floor was widened."""

Told = Callable[[str, int, int], None]
Said = Mapping[str, Mapping[int | None, float]]
"""Nats of the parity stage, by effect and element (`Parity.nats`)."""


@dataclass(frozen=True)
class Ways:
    """What an ablation leaves out. held_out: scores are of gaits left out of the fit; unknown: an error without a name
    is a rival."""

    held_out: bool = True
    unknown: bool = True


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
    ways: Ways | None = None, healthy: Healthy | None = None,
) -> Compared:  # fmt: skip
    """All effects against the refit nominal model `base` of this arena. floor_m: key-frame RMSE with nothing wrong, of
    the share `kept` of the intervals.
    healthy: the runs of before; an effect that helps there as well makes up for the simulator.

    sizes, told_by: of the parity stage: sizes to begin with, and the nats that it says for an effect at an element: the
    first SUSPECTED are fitted whatever the screening says. effects: only these. Raises NumericalError where nothing
    can be simulated.
    """
    ways = ways or Ways()
    calibration = calibration if healthy is not None else calibration.absolute()
    made = candidates(arena.model, sizes, touched(arena), arena.values(base.z[None])[0])
    known = [one for one in made if effects is None or one.effect in effects]
    told("screening", 0, 1)
    responses = screen(arena, base, known)
    told("screening", 1, 1)
    groups = groups_of(arena)
    short = _short(responses, told_by or {})
    nats = linear_gains(arena, base, short, healthy)
    linear = by_element(short, nats)
    short = [short[i] for i in np.argsort(-nats, kind="stable")]
    taken = {id(one) for one in short}
    responses = (*short, *(one for one in responses if id(one) not in taken))
    picked = _picked(responses, told_by or {})
    base, fits = _fitted(arena, base, picked, told)
    at_least = expected(arena)
    wider, unexplained = _widened(arena, [base, *fits[:LOOKED_AT]]) if ways.unknown else (1.0, 0.0)
    if wider > 1.0:
        arena.whiten(floor_m=wider * arena.floor_m)
        base, *fits = _again(arena, [base, *fits])
    told("left out", 0, 1)
    refit, *own = scores(arena, [base, *fits], groups, held_out=ways.held_out)
    old = chronic(arena, healthy, fits)
    pairs = _pairs(arena, base, fits, gains(refit, own) - old)
    if pairs:
        fits, own = [*fits, *pairs], [*own, *scores(arena, pairs, groups, held_out=ways.held_out)]
        old = np.concatenate([old, chronic(arena, healthy, pairs)])
    told("left out", 1, 1)
    material = Material(
        arena=arena, base=base, refit=refit, fits=tuple(fits), scores=tuple(own), responses=responses,
        chance=chance(arena, responses, groups, seed=seed), no_gap=no_gap(refit, floor_m, kept=kept), wider=wider,
        left=left(at_least, refit, own, healthy),
        unexplained=unexplained if ways.unknown else -np.inf, groups=groups, calibration=calibration,
        chronic=old,
        asked=None if effects is None else tuple(effects), parity=told_by or {}, linear=linear,
    )  # fmt: skip
    which = concluded(material)
    order = _in_order(which, fits, gains(refit, own) - old)
    return Compared(arena, base, tuple(fits[i] for i in order), refit, tuple(own[i] for i in order), which)


def _in_order(which: Which, fits: Sequence[Fit], gained: np.ndarray) -> list[int]:
    """Places of the fits: what is committed to, then as the ranking has it with its elements, two effects after the
    better of them."""
    place = {one.effect: k for k, one in enumerate(which.ranking)}
    seats = {one.effect: one.element for one in which.ranking}

    def key(i: int) -> tuple[bool, int, int, bool, float]:
        parts, own = fits[i].hypothesis.parts, fits[i].hypothesis.effects
        elsewhere = any(one.element not in (None, seats[one.effect]) for one in parts)
        return own != which.effects, min(place[name] for name in own), len(own), elsewhere, -float(gained[i])

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


def _short(responses: Sequence[Response], told_by: Said) -> list[Response]:
    """The first LOOKED_INTO elements of every effect, and those that the parity stage speaks for."""
    count: dict[str, int] = {}
    found = []
    for one in responses:
        name = one.candidate.effect
        count[name] = count.get(name, 0) + 1
        if count[name] <= LOOKED_INTO or told_by.get(name, {}).get(one.candidate.number, 0.0) >= LEAST_SAID:
            found.append(one)
    return found


def _picked(responses: Sequence[Response], told_by: Said) -> list[Response]:
    """The best elements of the best effects, and of those that the parity stage speaks for, its own element first."""
    testable = [one for one in responses if one.testable]
    best = list(dict.fromkeys(one.candidate.effect for one in testable))
    said = {name: max(told_by.get(name, {None: 0.0}).values()) for name in best}
    suspected = sorted((name for name in best if said[name] >= LEAST_SAID), key=lambda name: -said[name])
    found: list[Response] = []
    for name in dict.fromkeys([*best[:FITTED], *suspected[:SUSPECTED]]):
        rows = [one for one in testable if one.candidate.effect == name]
        if name in suspected:
            first = max(rows, key=lambda one: told_by[name].get(one.candidate.number, 0.0))
            rows = [first, *(one for one in rows if one is not first)]
        found += rows[:ELEMENTS]
    return found


def _fitted(arena: Arena, base: Fit, picked: Sequence[Response], told: Told) -> tuple[Fit, list[Fit]]:
    """The refit nominal model and fits of the picked candidates, all from the same start with the same budget: else
    who goes on gains what the other left. Candidates from several sizes and signs, the best of each, best first."""
    fits = Fits(arena)
    points: list[tuple[Hypothesis, np.ndarray, np.ndarray]] = [(Hypothesis(), base.z, base.x)]
    for response in picked:
        one = response.candidate
        for share in (1.0, 0.3, -1.0):
            x = np.clip(one.share(response.size, share), one.lower, one.upper)
            if share == 1.0 or np.any(np.abs(x - one.origin) > 1e-6):
                points.append((Hypothesis((one,)), response.start_z if share == 1.0 else base.z, x))
    begun = _begun(arena, fits, points)
    told("fits", 0, 1)
    fits.run(begun, iterations=FIRST)
    begun = _best_of(begun)
    fits.run(begun, told=lambda done, total: told("fits", done, total))
    best = _best_of(begun)
    nominal = next(fit for fit in best if not fit.hypothesis.parts)
    best = [fit for fit in best if fit is not nominal]
    going = [nominal, *best[:POLISHED]]
    for fit in going:  # from derivatives taken where it is now
        fit.ended, fit.damping = False, DAMPING
    fits.run(going)
    return nominal, _best_of(best)


def _begun(arena: Arena, fits: Fits, points: Sequence[tuple[Hypothesis, np.ndarray, np.ndarray]]) -> list[Fit]:
    values = np.concatenate([fits.values(h, z[None], x[None]) for h, z, x in points])
    residuals = arena.residuals(values, np.array([z for _, z, _ in points]))
    return [fits.begin(h, z, x, residual) for (h, z, x), residual in zip(points, residuals, strict=True)]


def _best_of(fits: Sequence[Fit]) -> list[Fit]:
    """Of every hypothesis the fit of least cost, best first."""
    best: dict[str, Fit] = {}
    for fit in fits:
        label = fit.hypothesis.label
        if label not in best or fit.cost < best[label].cost:
            best[label] = fit
    return sorted(best.values(), key=lambda fit: fit.cost)


def _widened(arena: Arena, fits: Sequence[Fit]) -> tuple[float, float]:
    """By how much the floor must grow to explain what the best of some fits leaves, and what that gains [nats]."""
    own = arena.floor_m
    solver = Fits(arena)
    raws = [arena.raw(solver.values(one.hypothesis, one.z[None], one.x[None]), one.z[None]) for one in fits]
    found: dict[float, np.ndarray] = {}
    for factor in (1.0, *WIDER):
        arena.whiten(floor_m=factor * own)
        found[factor] = np.array([arena.log_densities(raw) for raw in raws]).max(axis=0)
    arena.whiten(floor_m=own)
    more = {factor: float(np.minimum(one - found[1.0], ENOUGH).sum()) for factor, one in found.items()}
    factor = max(more, key=lambda one: more[one])
    return factor, more[factor]


def _again(arena: Arena, old: Sequence[Fit]) -> list[Fit]:
    """The fits with the arena's new covariance, each from where it was."""
    fits = Fits(arena)
    begun = _begun(arena, fits, [(fit.hypothesis, fit.z, fit.x) for fit in old])
    for new, fit in zip(begun, old, strict=True):
        new.start = fit.start
    fits.run(begun, iterations=SECOND)
    return begun


def _pairs(arena: Arena, base: Fit, fits: Sequence[Fit], gained: np.ndarray) -> list[Fit]:
    """The best single effect with the next PAIRED ones: where one effect leaves something, two may not.
    gained (fit,): by each [nats]."""
    if len(fits) < 2:
        return []
    order = np.argsort(-gained, kind="stable")
    first = fits[order[0]]
    others = [fits[i] for i in order[1:] if fits[i].hypothesis.effects != first.hypothesis.effects]
    seen: set[str] = set()
    points = []
    for other in others:
        if other.hypothesis.effects[0] in seen or len(seen) == PAIRED:
            continue
        seen.add(other.hypothesis.effects[0])
        both = Hypothesis((*first.hypothesis.parts, *other.hypothesis.parts))
        z = np.clip(first.z + other.z - base.z, arena.lower, arena.upper)
        points.append((both, z, np.concatenate([first.x, other.x])))
        points.append((both, first.z, np.concatenate([first.x, 0.5 * (other.x + other.hypothesis.stack("off"))])))
    fits_of = Fits(arena)
    begun = _begun(arena, fits_of, points)
    fits_of.run(begun, iterations=SECOND + 1)
    return _best_of(begun)[:3]

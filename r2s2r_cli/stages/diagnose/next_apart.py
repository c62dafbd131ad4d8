"""How far candidates would stand apart on a policy that nobody has run, counted as the comparison counts.

The policy is imagined, and cut into pieces that begin anew where the most probable candidate would have been seen. Each
candidate in turn is the truth, with nuisances a little off from where its fit stands. All may fit nuisances and their
own numbers to what is seen then: only what is left tells them apart, and no piece decides alone (`which/bounded.py`).
The truth may be left with something as well. Where a robot tips over a little nuisance is enough for another instant,
so that even the right simulator errs by decimetres there: such a piece speaks for nobody, or for the wrong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from r2s2r_cli.stages.diagnose.imagined import part
from r2s2r_cli.stages.diagnose.which.arena import SECANT, Arena
from r2s2r_cli.stages.diagnose.which.bounded import bounded
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.mixture import ENOUGH
from r2s2r_cli.stages.diagnose.which.pieces import LEAST_SPEED_SD, length_of
from r2s2r_cli.stages.diagnose.which.starting import LOST_M
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.white import FLOOR_S

ROUNDS = 6
PAIRS = 2
"""Of draws of the nuisances, one to each side, that a truth is imagined with."""


def apart(arena: Arena, whole: Stretch, fits: Sequence[Fit]) -> np.ndarray:
    """Nats (truth, candidate) by which each truth is told from each candidate, 0 from itself, on an imagined policy
    `whole`, whose frames alone count. fits: most probable first; the refit nominal model, where it is one of them, is
    where derivatives by the nuisances are taken."""
    solver = Fits(arena)
    p = len(arena.engine)
    middle = next((fit for fit in fits if not fit.hypothesis.parts), fits[0])
    by = SECANT * np.array([arena.model.numbers[k].sd for k in arena.engine])
    moved = np.clip(middle.z[:p] + np.where(middle.z[:p] + by > arena.upper[:p], -by, by), arena.lower[:p], None)
    around = np.repeat(middle.z[None], p, axis=0)
    around[np.arange(p), np.arange(p)] = moved
    rows, places, at = [], [], 0
    for fit in fits:  # of each: where it stands, its own numbers moved, its nuisances drawn
        sizes, count, drawn = _sizes(fit), len(fit.x), drawn_about(arena, fit)
        z = np.concatenate([np.repeat(fit.z[None], 1 + count, axis=0), drawn])
        rows.append(solver.values(fit.hypothesis, z, np.concatenate([sizes, np.repeat(fit.x[None], len(drawn), 0)])))
        places.append((at, slice(at + 1, at + 1 + count), slice(at + 1 + count, at + len(z))))
        at += len(z)
    rows.append(solver.values(middle.hypothesis, around, np.repeat(middle.x[None], p, axis=0)))
    many = _pieces(arena, whole, rows[0][0])
    seen = [_white(arena, one, sight) for one, sight in zip(many, _sights(arena, many, rows), strict=True)]
    step = np.where(moved == middle.z[:p], np.inf, moved - middle.z[:p])
    middle_row = places[[fit is middle for fit in fits].index(True)][0]
    truths = [one[np.concatenate([np.r_[drawn_rows] for _, _, drawn_rows in places])] for one in seen]
    costs = []
    for fit, (own, sizes_rows, _) in zip(fits, places, strict=True):
        width = np.diag(_sizes(fit)[1:] - fit.x)[:, None] if len(fit.x) else np.zeros((0, 1))
        columns = []
        for one in seen:
            by_nuisance = (one[at:] - one[middle_row]) / step[:, None]
            by_nuisance[[k for k in solver.overruled(fit.hypothesis) if k < p]] = 0.0
            columns.append(np.concatenate([by_nuisance, (one[sizes_rows] - one[own]) / width]))
        prior = np.zeros((p + len(fit.x), p + len(fit.x)))
        prior[:p, :p] = arena.precision[:p, :p]
        prior[range(p, len(prior)), range(p, len(prior))] = (PRIOR_SCALES * fit.hypothesis.stack("scale")) ** -2.0
        costs.append(left([truth - one[own] for truth, one in zip(truths, seen, strict=True)], columns, prior))
    nats = np.mean(np.array(costs).reshape(len(fits), len(fits), 2 * PAIRS), axis=2).T
    return np.asarray(nats - np.diag(nats)[:, None])


def left(difference: Sequence[np.ndarray], columns: Sequence[np.ndarray], prior: np.ndarray) -> np.ndarray:
    """What counts (case,) [nats] of differences (case, number) by piece, white, when the numbers whose columns (n,
    number) are given are fitted to each case, with prior precision (n, n). They are fitted as fits are, each piece
    fully up to `mixture.ENOUGH` and by its logarithm above, and counted as the ranking does: less of each piece."""
    H = np.array([J @ J.T for J in columns])
    g = np.array([d @ J.T for J, d in zip(columns, difference, strict=True)])
    square = np.array([np.sum(d**2, axis=1) for d in difference])
    x, best = np.zeros(g.shape[1:]), np.full(square.shape[1], np.inf)
    for _ in range(ROUNDS):
        fitted = np.sum((np.einsum("kij,cj->kci", H, x) - 2.0 * g) * x, axis=2)
        half = 0.5 * np.maximum(square + fitted, 0.0)
        nothing, counted = bounded(np.stack([np.zeros_like(half), -half]))
        best = np.minimum(best, np.sum(nothing - counted, axis=0) + 0.5 * np.sum(x @ prior * x, axis=1))
        w = 1.0 / (1.0 + half / ENOUGH)
        normal = np.einsum("kc,kij->cij", w, H) + prior
        x = np.linalg.solve(normal, np.einsum("kc,kci->ci", w, g)[..., None])[..., 0]
    return best


def drawn_about(arena: Arena, fit: Fit) -> np.ndarray:
    """Nuisances (draw, p + q) about those of a fit, within their bounds: those of the engine are off by SECANT of what
    is known of them before today's runs. The same draws for all policies, which are compared."""
    p = len(arena.engine)
    root = np.linalg.cholesky(np.linalg.inv(arena.precision)[:p, :p])
    one = SECANT * np.random.default_rng(0).standard_normal((PAIRS, p)) @ root.T
    found = np.repeat(fit.z[None], 2 * PAIRS, axis=0)
    found[:, :p] = np.clip(fit.z[:p] + np.concatenate([one, -one]), arena.lower[:p], arena.upper[:p])
    return found


def _sizes(fit: Fit) -> np.ndarray:
    """The numbers of a fit, and each moved by a secant away from the nearer bound, (1 + n, n)."""
    scale = SECANT * fit.hypothesis.stack("scale")
    by = np.where(fit.x + scale > fit.hypothesis.stack("upper"), -scale, scale)
    return np.concatenate([fit.x[None], fit.x + np.diag(by)]) if len(fit.x) else fit.x[None]


def _pieces(arena: Arena, whole: Stretch, values: np.ndarray) -> list[Stretch]:
    """The policy in pieces as long as those that are fitted."""
    frames = len(whole.t)
    count = max(1, round(float(whole.t[-1] - whole.window.start) / length_of(whole.window.run)))
    return pieces_at(arena, whole, values, sorted({0, *(round(frames * k / count) for k in range(1, count)), frames}))


def pieces_at(arena: Arena, whole: Stretch, values: np.ndarray, edges: Sequence[int]) -> list[Stretch]:
    """The policy in pieces between frames `edges`, each from the state in which the robot with these values is
    there."""
    before = [part(whole, 0, edge) for edge in edges[1:-1]]
    states = arena.replayer.finals(before, values) if before else None
    found = []
    for k, (a, b) in enumerate(pairwise(edges)):
        one = replace(part(whole, a, b), piece=k, order=k)
        if k and states is not None:
            one = replace(one, window=replace(one.window, state=states.select(k - 1)))
        found.append(one)
    return found


def _sights(arena: Arena, many: Sequence[Stretch], rows: Sequence[np.ndarray]) -> list[np.ndarray]:
    """What is seen of each piece, (k, channel, F) [m]; at most LOST_M from what the first row shows."""
    found = []
    for one, sight in zip(many, arena.replayer.seen(many, np.concatenate(rows)), strict=True):
        parts = [sight.caps.reshape(*sight.caps.shape[:2], -1)]
        if one.length is not None:
            parts.append(sight.length)
        seen = np.concatenate(parts, axis=-1).transpose(0, 2, 1)
        first = np.nan_to_num(seen[:1])
        found.append(first + np.clip(np.nan_to_num(seen, nan=LOST_M) - first, -LOST_M, LOST_M))
    return found


def _white(arena: Arena, one: Stretch, seen: np.ndarray) -> np.ndarray:
    """(k, channel, F) over noise, floor, and how well the start of a piece is seen, (k, channel F)."""
    run = one.window.run
    since = one.t - one.window.start
    place = float(np.sqrt(np.mean(run.sd_p**2)))
    speed = float(np.hypot(np.sqrt(np.mean(run.sd_v**2)), LEAST_SPEED_SD))
    shared = np.minimum(since[:, None], since[None]) / FLOOR_S * (arena.floor_m**2 / 3.0)
    shared = shared + place**2 + speed**2 * since[:, None] * since[None]
    sd = arena.noise * one.noise.reshape(len(since), -1).T
    if one.length_sd is not None and one.length is not None:
        sd = np.concatenate([sd, one.length_sd.T])
    root = np.linalg.inv(np.linalg.cholesky(shared[None] + np.eye(len(since)) * sd[:, :, None] ** 2))
    found = np.einsum("cfg,kcg->kcf", root, seen)
    return np.asarray(found.reshape(len(seen), -1))

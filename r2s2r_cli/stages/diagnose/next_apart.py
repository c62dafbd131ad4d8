"""How far two candidates would stand apart on a policy that nobody has run, counted as the comparison counts.

The policy is imagined with the first candidate as the truth, and cut into pieces that begin anew where that one would
have been seen. The other one may fit its nuisances and its own numbers to what it sees there: only what is left tells
them apart, and no piece decides alone (`which/mixture.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import SECANT, Arena
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.mixture import ENOUGH
from r2s2r_cli.stages.diagnose.which.pieces import LEAST_SPEED_SD, length_of
from r2s2r_cli.stages.diagnose.which.starting import LOST_M
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.white import FLOOR_S
from r2s2r_cli.stages.identify.windows import Window

ROUNDS = 6


def apart(arena: Arena, whole: Stretch, truth: Fit, others: Sequence[Fit]) -> tuple[float, ...]:
    """Nats between the truth and each of others on an imagined policy `whole`, whose frames alone count."""
    solver = Fits(arena)
    own = solver.values(truth.hypothesis, truth.z[None], truth.x[None])
    many = _pieces(arena, whole, own[0])
    p = len(arena.engine)
    by = SECANT * np.array([arena.model.numbers[k].sd for k in arena.engine])
    moved = np.clip(truth.z[:p] + np.where(truth.z[:p] + by > arena.upper[:p], -by, by), arena.lower[:p], None)
    around = np.repeat(truth.z[None], p, axis=0)
    around[np.arange(p), np.arange(p)] = moved
    rows = [own, solver.values(truth.hypothesis, around, np.repeat(truth.x[None], p, axis=0))]
    for fit in others:
        rows.append(solver.values(fit.hypothesis, np.repeat(fit.z[None], 1 + len(fit.x), axis=0), _sizes(fit)))
    seen = [_white(arena, one, sight) for one, sight in zip(many, _sights(arena, many, rows), strict=True)]
    step = np.where(moved == truth.z[:p], np.inf, moved - truth.z[:p])
    found, first = [], 1 + p
    for fit in others:
        last = first + 1 + len(fit.x)
        width = np.array([size - fit.x for size in _sizes(fit)[1:]]).sum(axis=1) if len(fit.x) else np.zeros(0)
        columns = [
            np.concatenate(
                [(one[1 : 1 + p] - one[0]) / step[:, None], (one[first + 1 : last] - one[first]) / width[:, None]]
            )
            for one in seen
        ]
        prior = np.zeros((p + len(fit.x), p + len(fit.x)))
        prior[:p, :p] = arena.precision[:p, :p]
        prior[range(p, len(prior)), range(p, len(prior))] = (PRIOR_SCALES * fit.hypothesis.stack("scale")) ** -2.0
        found.append(left([one[first] - one[0] for one in seen], columns, prior))
        first = last
    return tuple(found)


def left(difference: Sequence[np.ndarray], columns: Sequence[np.ndarray], prior: np.ndarray) -> float:
    """What is left [nats] of differences (number,) by piece, white, when the numbers whose columns (n, number) are
    given are fitted to them, with prior precision (n, n): half the squares of each piece fully up to ENOUGH, by their
    logarithm above."""
    H = np.array([J @ J.T for J in columns])
    g = np.array([J @ d for J, d in zip(columns, difference, strict=True)])
    square = np.array([d @ d for d in difference])
    x, best = np.zeros(len(prior)), np.inf
    for _ in range(ROUNDS):
        half = 0.5 * np.maximum(square - 2.0 * g @ x + np.einsum("i,kij,j->k", x, H, x), 0.0)
        best = min(best, float(np.sum(ENOUGH * np.log1p(half / ENOUGH)) + 0.5 * x @ prior @ x))
        w = 1.0 / (1.0 + half / ENOUGH)
        x = np.linalg.lstsq(np.einsum("k,kij->ij", w, H) + prior, w @ g, rcond=None)[0]
    return best


def _sizes(fit: Fit) -> np.ndarray:
    """The numbers of a fit, and each moved by a secant away from the nearer bound, (1 + n, n)."""
    scale = SECANT * fit.hypothesis.stack("scale")
    by = np.where(fit.x + scale > fit.hypothesis.stack("upper"), -scale, scale)
    return np.concatenate([fit.x[None], fit.x + np.diag(by)]) if len(fit.x) else fit.x[None]


def _pieces(arena: Arena, whole: Stretch, values: np.ndarray) -> list[Stretch]:
    """The policy in pieces, each from the state in which the robot with these values is there."""
    run = whole.window.run
    frames = len(whole.t)
    count = max(1, round(float(whole.t[-1] - whole.window.start) / length_of(run)))
    edges = sorted({0, *(round(frames * k / count) for k in range(1, count)), frames})
    before = [replace(whole, window=_cut(whole, 0, edge), piece=0) for edge in edges[1:-1]]
    states = arena.replayer.finals(before, values) if before else None
    found = []
    for k, (a, b) in enumerate(pairwise(edges)):
        window = _cut(whole, a, b)
        if k and states is not None:
            window = replace(window, state=states.select(k - 1))
        found.append(replace(
            whole, window=window, piece=k, order=k, caps=whole.caps[a:b], noise=whole.noise[a:b],
            length=None if whole.length is None else whole.length[a:b],
            length_sd=None if whole.length_sd is None else whole.length_sd[a:b],
        ))  # fmt: skip
    return found


def _cut(whole: Stretch, a: int, b: int) -> Window:
    """Frames a to b of a policy, after the one before them."""
    window = whole.window
    frames = window.frames[a:b]
    return replace(window, first=int(frames[0]) - 1, frames=frames, key=window.key[a:b], place=window.place[a:b])


def _sights(arena: Arena, many: Sequence[Stretch], rows: Sequence[np.ndarray]) -> list[np.ndarray]:
    """What is seen of each piece, (k, channel, F) [m]; at most LOST_M from what the truth, the first row, shows."""
    found = []
    for one, sight in zip(many, arena.replayer.seen(many, np.concatenate(rows)), strict=True):
        parts = [sight.caps.reshape(*sight.caps.shape[:2], -1)]
        if one.length is not None:
            parts.append(sight.length)
        seen = np.concatenate(parts, axis=-1).transpose(0, 2, 1)
        truth = np.nan_to_num(seen[:1])
        found.append(truth + np.clip(np.nan_to_num(seen, nan=LOST_M) - truth, -LOST_M, LOST_M))
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

"""A winch in one dimension: motor command -> length of cable that it lets in, with the laws that may be missing.

Free of contact: what a sensor reads while its winch turns is what was wound, whatever the robot does on the floor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from r2s2r_cli.stages.diagnose.parity.series import Series
from r2s2r_cli.stages.identify.commands import CommandLog

GRID_S = 0.005
"""[s] of the simulated winch."""
BEFORE_S, AFTER_S = 0.10, 0.40
"""Readings so long before and after the command belong to a ramp."""
LEAST_RAMP_S = 0.30
"""Shorter commands are the last millimetres of a controller, not a ramp."""


@dataclass(frozen=True)
class Ramps:
    """Readings of all ramps of all runs. length: what was read [m], (row,); ramp: number of the ramp, (row,); cable:
    place of its winch among the actuated, way: +1 reels in, -1 pays out, run: of each ramp, (ramp,); pull: tension
    proxy of each ramp [1]. turned: the commands on a grid and where each row lies on it.
    """

    length: np.ndarray
    t: np.ndarray
    ramp: np.ndarray
    cable: np.ndarray
    way: np.ndarray
    run: np.ndarray
    grids: tuple[Grid, ...]

    def __len__(self) -> int:
        return len(self.cable)


@dataclass(frozen=True)
class Grid:
    """Commands of one run on a grid: start [s], u (row, actuated); slack: mean stretch of the passive cables over its
    usual one at each row [1], which is how tense the robot is."""

    start: float
    u: np.ndarray
    tense: np.ndarray


def ramps(runs: tuple[Series, ...], actuated: tuple[int, ...], rest: np.ndarray, *, seen: bool) -> Ramps:
    """Of runs. rest: of the passive cables [m], (cable,), nan for others. seen: cap distances instead of sensors."""
    rows: list[list[np.ndarray]] = [[], [], []]
    table: list[tuple[int, int, int]] = []
    grids = []
    for number, one in enumerate(runs):
        t, length = (one.t, one.seen) if seen else one.heard
        grid = _grid(one, rest)
        grids.append(grid)
        for cable, k in enumerate(actuated):
            good = np.isfinite(length[:, k])
            for begin, end, way in _spells(grid.u[:, cable]):
                t0, t1 = (grid.start + GRID_S * edge for edge in (begin, end))
                if t1 - t0 < LEAST_RAMP_S:
                    continue
                own = good & (t >= t0 - BEFORE_S) & (t <= _next(grid, cable, end, t1 + AFTER_S))
                if own.sum() < 5:
                    continue
                rows[0].append(length[own, k])
                rows[1].append(t[own])
                rows[2].append(np.full(int(own.sum()), len(table)))
                table.append((cable, way, number))
    joined = [np.concatenate(part) if part else np.zeros(0) for part in rows]
    made = np.array(table, dtype=int).reshape(-1, 3)
    return Ramps(joined[0], joined[1], joined[2].astype(int), made[:, 0], made[:, 1], made[:, 2], tuple(grids))


def wound(data: Ramps, law: Mapping[str, float], speed: float) -> np.ndarray:
    """Seconds at full speed that each row's winch has turned since its ramp began, (row,), + reels in, under a law.

    law: sizes by name; latency, lag [s], sag [1/s], load [1 per motor], spool [1 per m], play [m], droop [1], zone [1].
    speed: of the winches at full command [m/s], which turns play and wound length into seconds.
    """
    turned = [_chain(grid, law, speed) for grid in data.grids]
    found = np.zeros(len(data.length))
    for number, (grid, path) in enumerate(zip(data.grids, turned, strict=True)):
        rows = np.flatnonzero(data.run[data.ramp] == number)
        at = (data.t[rows] - grid.start) / GRID_S
        low = np.clip(at.astype(int), 0, len(path) - 2)
        share = np.clip(at - low, 0.0, 1.0)
        cable = data.cable[data.ramp[rows]]
        found[rows] = path[low, cable] * (1 - share) + path[low + 1, cable] * share
    return found


def _chain(grid: Grid, law: Mapping[str, float], speed: float) -> np.ndarray:
    """What the winches have turned [s at full speed], (row + 1, actuated)."""
    u = grid.u
    zone = law.get("zone", 0.0)
    if zone:
        u = np.where(np.abs(u) < zone, 0.0, u)
    time = GRID_S * np.arange(len(u))[:, None]
    if latency := law.get("latency", 0.0):
        u = _shifted(u, latency / GRID_S)
    if sag := law.get("sag", 0.0):
        u = u * (1.0 - sag * time)
    if load := law.get("load", 0.0):
        u = u * (1.0 - load * np.abs(u).sum(axis=1, keepdims=True))
    if droop := law.get("droop", 0.0):
        u = np.where(u > 0, u * (1.0 - droop * grid.tense[:, None]), u)
    if lag := law.get("lag", 0.0):
        u = _lagged(u, lag)
    path = np.vstack([np.zeros((1, u.shape[1])), np.cumsum(u * GRID_S, axis=0)])
    if spool := law.get("spool", 0.0):
        # d wound / d turned = 1 + spool wound
        wound_m = np.expm1(np.clip(spool * speed * path, -2.0, 2.0)) / spool
        path = wound_m / speed
    if play := law.get("play", 0.0):
        path = _played(path, play / speed)
    return path


def _shifted(u: np.ndarray, rows: float) -> np.ndarray:
    """Later by so many rows, not whole."""
    at = np.arange(len(u)) - rows
    low = np.floor(at).astype(int)
    share = (at - low)[:, None]

    def row(k: np.ndarray) -> np.ndarray:
        return np.where((k >= 0)[:, None], u[np.clip(k, 0, len(u) - 1)], 0.0)

    return np.asarray((1 - share) * row(low) + share * row(low + 1))


def _lagged(u: np.ndarray, lag: float) -> np.ndarray:
    """First-order lag, exact for commands that are held."""
    from scipy.signal import lfilter

    keep = float(np.exp(-GRID_S / lag))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], u, axis=0))


def _played(path: np.ndarray, play: float) -> np.ndarray:
    """Play operator: the output follows once the play is used up; the cable was let out last, so it lies there.

    Over a stretch that only rises or falls the output is the input cut off, so that there is no loop over rows.
    """
    found = np.empty_like(path)
    for k in range(path.shape[1]):
        x = path[:, k]
        way = np.sign(np.diff(x))
        turns = np.flatnonzero(np.diff(way[way != 0])) if way.any() else np.zeros(0, int)
        moving = np.flatnonzero(way)
        edges = [0, *(moving[turns + 1]).tolist(), len(x) - 1]
        out = x[0] - play
        for a, b in pairwise(edges):
            part = np.minimum(np.maximum(out, x[a : b + 1] - play), x[a : b + 1])
            found[a : b + 1, k] = part
            out = float(part[-1])
    return found


def _grid(one: Series, rest: np.ndarray) -> Grid:
    run = one.run.caps
    start, end = float(one.t[0]), float(one.t[-1]) + AFTER_S
    count = max(2, int(np.ceil((end - start) / GRID_S)))
    u = CommandLog(run).means(start, count, step=GRID_S, delay=0.0)
    passive = np.isfinite(rest)
    length = np.where(np.isfinite(one.sensed), one.sensed, one.seen)[:, passive]
    tense = np.ones(len(one.t))
    if passive.any():
        stretch = np.maximum(np.nan_to_num(length - rest[passive]), 0.0).mean(axis=1)
        usual = float(np.mean(stretch))
        tense = stretch / usual if usual > 0 else tense
    at = start + GRID_S * np.arange(count)
    return Grid(start, u, np.interp(at, one.t, tense))


def _spells(u: np.ndarray) -> list[tuple[int, int, int]]:
    """(first row, row after the last, sign) of commands of one sign."""
    sign = np.sign(u).astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sign, [0]])))
    return [(int(a), int(b), int(sign[a])) for a, b in pairwise(edges) if sign[a]]


def _next(grid: Grid, cable: int, end: int, until: float) -> float:
    """`until`, or the moment before it at which the winch turns again."""
    again = np.flatnonzero(grid.u[end:, cable])
    return min(until, grid.start + GRID_S * (end + int(again[0]))) if len(again) else until

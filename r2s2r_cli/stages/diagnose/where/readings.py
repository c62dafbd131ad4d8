"""What the innovations follow: motors that run, holding still, time, one cap, a phase of the gait."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from r2s2r_cli.stages.diagnose.where.columns import Design
from r2s2r_cli.stages.diagnose.where.found import Reading
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.identify.commands import CommandLog

DRAWS = 499
WORDS = {
    "command": ("follows the command: it grows while motors run", "less while motors run"),
    "hold": ("grows while holding", "fades while holding"),
    "time": ("grows with the time of the run", "fades with the time of the run"),
    "cap": ("follows single caps", "follows single caps"),
    "phase": ("follows the phase of the gait", "follows the phase of the gait"),
}
"""What a reading says where it goes up, and where it goes down."""


def readings(arena: Arena, design: Design, seed: int) -> tuple[Reading, ...]:
    """Best first. Of the energy of the whitened innovations, interval by interval and cap by cap: a share of its
    variance that a gait which was left out confirms, and its chance under shuffled labels."""
    energy, rows = _table(arena, design)
    rng = np.random.default_rng(seed)
    found = []
    ways: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "command": lambda x: x[:, [0]], "hold": lambda x: x[:, [1]], "time": lambda x: x[:, [2]],
        "cap": lambda x: _dummies(x[:, 3]), "phase": lambda x: _dummies(x[:, 4]),
    }  # fmt: skip
    for name, make in ways.items():
        X = make(rows)
        r2, slope = _confirmed(energy, X, rows[:, 5])
        # Labels are shuffled within gaits, so that gaits that differ as a whole are no chance.
        drawn = [_confirmed(energy, X[_shuffled(rows[:, 5], rng)], rows[:, 5])[0] for _ in range(DRAWS // 5)]
        p = float((1 + np.sum(np.array(drawn) >= r2)) / (len(drawn) + 1))
        found.append(Reading(name, float(max(r2, 0.0)), p, WORDS[name][0 if slope >= 0 else 1]))
    return tuple(sorted(found, key=lambda one: (one.p, -one.r2)))


def _table(arena: Arena, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Logarithm of the energy of parts of intervals, (row,), and what they may follow, (row, 6): motors that run,
    seconds since they stopped, time in the run, cap, number of the interval in its run, gait. Each interval has
    three parts."""
    values, rows = [], []
    for k, one in enumerate(arena.many):
        own = design.innovation[k]
        log = CommandLog(one.window.run)
        running = np.abs(log.at(one.t)).sum(axis=1)
        still = np.zeros(len(one.t))
        for f in range(1, len(one.t)):
            still[f] = 0.0 if running[f] > 0 else still[f - 1] + one.t[f] - one.t[f - 1]
        for part in np.array_split(np.arange(len(one.t)), min(3, len(one.t))):
            energy = np.log(np.mean(own[part] ** 2, axis=(0, 2)) + 1e-6)
            for cap, value in enumerate(energy):
                values.append(value)
                rows.append((running[part].mean(), still[part].mean(), one.t[part].mean(), cap, one.interval,
                             design.gait[k]))  # fmt: skip
    return np.array(values), np.array(rows, dtype=float)


def _dummies(x: np.ndarray) -> np.ndarray:
    return np.asarray((x[:, None] == np.unique(x)[None, :-1]).astype(float))


def _shuffled(group: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    order = np.arange(len(group))
    for one in np.unique(group):
        own = np.flatnonzero(group == one)
        order[own] = rng.permutation(own)
    return order


def _confirmed(y: np.ndarray, X: np.ndarray, group: np.ndarray) -> tuple[float, float]:
    """Share of the variance within groups that is predicted from the other groups, and the sign of the first slope."""
    names = np.unique(group)
    left, total, slope = 0.0, 0.0, 0.0
    for one in names:
        out = group == one
        train = ~out if len(names) > 1 else out
        A, b = X[train] - X[train].mean(axis=0), y[train] - y[train].mean()
        beta = np.linalg.solve(A.T @ A + 1e-3 * len(b) * np.eye(X.shape[1]), A.T @ b) if X.shape[1] else np.zeros(0)
        rest = y[out] - y[out].mean()
        own = (X[out] - X[out].mean(axis=0)) @ beta
        left += float(np.sum((rest - own) ** 2))
        total += float(np.sum(rest**2))
        slope += float(beta[0]) if len(beta) else 0.0
    return (1.0 - left / total if total > 0 else 0.0), slope

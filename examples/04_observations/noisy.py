"""Late against early noisy observations of x = f(v t), the speed v unknown (the paper's fig. noisy_obs_error).

One observation at time t with noise sd determines v with standard deviation sd / |df/dv| = sd / (t |f'(v t)|): exact
for the line f(s) = s, to first order else. Late is better on a line, as 1 / t. Where x turns (f' = 0) one observation
says little however late, and may fit several speeds. All numbers are for the true v = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SD = 0.05
"""Noise of an observation [m]."""


@dataclass(frozen=True)
class Path1D:
    """Position f [m] over the way s = v t, and its derivative."""

    name: str
    f: Callable[[Array], Array]
    slope: Callable[[Array], Array]


LINE = Path1D("x = v t", lambda s: s, np.ones_like)
ZIGZAG = Path1D("x = v t + 0.8 sin(2 v t)", lambda s: s + 0.8 * np.sin(2 * s), lambda s: 1 + 1.6 * np.cos(2 * s))
PATHS = (LINE, ZIGZAG)
SPEEDS = np.linspace(0.05, 2.0, 20000)
"""Speeds among which a fit chooses [m/s]."""


def closed_form(path: Path1D, t: Array, sd: float = SD) -> Array:
    """Standard deviation of v from one observation at each time t [m/s]."""
    return sd / (t * np.abs(path.slope(t)))


def closed_form_all(path: Path1D, t: Array, sd: float = SD) -> float:
    """Standard deviation of the least-squares v from observations at all times t [m/s]."""
    return float(sd / np.sqrt(np.sum((t * path.slope(t)) ** 2)))


def monte_carlo(path: Path1D, t: float, draws: int, rng: np.random.Generator, sd: float = SD) -> Array:
    """Speeds from 0.05 to 2 m/s that fit one noisy observation at t best [m/s], (draw,)."""
    seen = path.f(np.array(t)) + sd * rng.standard_normal(draws)
    reached = path.f(SPEEDS * t)
    order = np.argsort(reached)
    right = np.clip(np.searchsorted(reached[order], seen), 1, len(SPEEDS) - 1)
    nearer = np.abs(seen - reached[order[right]]) < np.abs(seen - reached[order[right - 1]])
    return SPEEDS[order[np.where(nearer, right, right - 1)]]


def solutions(path: Path1D, t: float) -> int:
    """How many speeds from 0.05 to 2 m/s pass exactly through the true position at t."""
    above = path.f(SPEEDS * t) > path.f(np.array(t))
    return int(np.sum(above[1:] != above[:-1]))


def report(draws: int = 20000) -> str:
    """Table over the times: closed form against Monte Carlo, and how many speeds fit."""
    rng = np.random.default_rng(0)
    lines = [f"one observation with {SD:g} m of noise; sd of the speed [m/s], {draws} draws"]
    for path in PATHS:
        lines.append(f"{path.name}\n  t [s]   closed form   Monte Carlo   speeds that fit without noise")
        for t in (0.3, 1.0, 3.0, 4.2, 6.0, 9.0):
            spread = float(np.sqrt(np.mean((monte_carlo(path, t, draws, rng) - 1) ** 2)))
            lines.append(
                f"  {t:5.1f}   {float(closed_form(path, np.array(t))):11.4f}   {spread:11.4f}   {solutions(path, t)}"
            )
        times = np.arange(1, 91) / 10
        last, everything = float(closed_form(path, times)[-1]), closed_form_all(path, times)
        lines.append(f"  90 observations to 9 s: the last alone {last:.4f}, all of them {everything:.4f}")
    return "\n".join(lines) + "\n"

"""Profile likelihood: one parameter held on a grid, everything else fitted again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.covariance import Covariance
from r2s2r_cli.stages.identify.trust.information import inverse, widths
from r2s2r_cli.stages.identify.trust.wrapped import Wrapped

ALIKE = 1.3
"""Ends of two intervals whose distances from the value differ by less than this factor are alike."""
LOWER = 0.02
"""Fall of the cost that a profile may find by chance of ending iterations early."""


@dataclass(frozen=True)
class Profile:
    """Of one parameter. value: grid, units, rising, (k,). rise: cost minus that of the solution, all others fitted,
    (k,). threshold: rise at the ends of the interval. lower, upper: its ends, units, nan where the cost does not rise
    that far within the grid. quadratic: ends by the covariance. better: all unknowns where the cost was found lower
    than at the solution, which is then no minimum. words: how the two intervals differ.
    """

    name: str
    value: np.ndarray
    rise: np.ndarray
    threshold: float
    lower: float
    upper: float
    quadratic: tuple[float, float]
    better: np.ndarray | None
    words: str


def profile(
    problem: Problem,
    solution: Solution,
    frees: Sequence[Free],
    index: int,
    spread: Covariance,
    *,
    loss: Loss = LOSSES["none"],
    points: int = 9,
    reach: float = 3.0,
    max_iterations: int = 6,
) -> Profile:
    """Of parameter `index`, on `points` values out to `reach` standard deviations or to its bounds.

    Each point starts from its neighbour, moved as the covariance says the others follow. Rises are compared with those
    of a covariance whose inflation counts (Raue et al. 2009, Bioinformatics 25, 1923, with a threshold scaled by it):
    on a linear problem both intervals are equal. Points that cannot be simulated end the grid.
    """
    free, z0 = frees[index], float(solution.z[index])
    variance, bread = float(spread.covariance[index, index]), float(spread.bread[index, index])
    known = np.isfinite(variance) and bread > 0
    sd = float(np.sqrt(variance)) if known else float(widths(problem, frees)[index])
    scale = variance / bread if known else spread.inflation
    full = inverse(solution.normal)
    follow = full[:, index] / full[index, index] if full[index, index] > 0 else np.zeros(len(solution.z))
    follow[index] = 1.0
    ends = float(spread.quantile[index])
    offsets = sd * max(reach, 1.2 * ends) * np.arange(1, points // 2 + 1) / (points // 2)
    found = [(z0, solution.cost)]
    best: tuple[float, np.ndarray] = (solution.cost - LOWER, solution.z)
    for sign in (-1.0, 1.0):
        z = solution.z
        for offset in offsets:
            at = float(np.clip(z0 + sign * offset, problem.lower[index], problem.upper[index]))
            if at == z[index]:
                break
            point = _fit(problem, z + (at - z[index]) * follow, index, at, loss, max_iterations)
            if point is None:
                break
            z = point.z
            found.append((at, point.cost))
            if point.cost < best[0]:
                best = (point.cost, point.z)
    found.sort()
    grid, cost = np.array([at for at, _ in found]), np.array([one for _, one in found])
    rise = cost - cost.min() if best[1] is not solution.z else cost - solution.cost
    low, high = interval(grid, rise / scale, ends)
    value = np.array([free.from_z(float(one)) for one in grid])
    both = tuple(free.from_z(one) if np.isfinite(one) else np.nan for one in (low, high))
    on_box = grid[0] <= problem.lower[index], grid[-1] >= problem.upper[index]
    centre = float(grid[np.argmin(rise)])
    words = _words(free, (centre - low, high - centre), sd * ends, value, on_box)
    quadratic = float(spread.lower[index]), float(spread.upper[index])
    better = None if best[1] is solution.z else best[1]
    return Profile(
        free.name, value, rise, 0.5 * scale * ends**2, both[0], both[1], quadratic, better,
        words if better is None else f"a better fit was found at {free.from_z(float(better[index])):.4g}: {words}",
    )  # fmt: skip


def profiles(
    problem: Problem,
    solution: Solution,
    frees: Sequence[Free],
    indices: Sequence[int],
    spread: Covariance,
    *,
    progress: Callable[[float], None] | None = None,
    **options: object,
) -> tuple[Profile, ...]:
    """Of several parameters, `Identifiability.weakest[:3]` of them; progress is told the share that is done."""
    done = []
    for index in indices:
        done.append(profile(problem, solution, frees, index, spread, **options))  # type: ignore[arg-type]
        if progress is not None:
            progress(len(done) / len(indices))
    return tuple(done)


def interval(grid: np.ndarray, rise: np.ndarray, quantile: float) -> tuple[float, float]:
    """Where twice the rise (k,) over the rising grid (k,) reaches quantile^2, nearest to its minimum on either side;
    nan where it does not. Signed roots of the rise are interpolated: for a parabola they are a line, so that is exact.
    """
    root = np.sqrt(np.maximum(2.0 * rise, 0.0))
    middle = int(np.argmin(rise))
    ends = []
    for path in (range(middle, -1, -1), range(middle, len(grid))):
        end, before = np.nan, middle
        for k in path:
            if root[k] >= quantile and k != before:
                end = grid[before] + (quantile - root[before]) / (root[k] - root[before]) * (grid[k] - grid[before])
                break
            before = k
        ends.append(float(end))
    return ends[0], ends[1]


def _fit(
    problem: Problem, start: np.ndarray, index: int, at: float, loss: Loss, max_iterations: int
) -> Solution | None:
    """All unknowns but one; None where none of it can be simulated."""
    lower, upper = problem.lower.copy(), problem.upper.copy()
    lower[index] = upper[index] = start[index] = at
    try:
        return levenberg_marquardt(
            Wrapped(problem, lower=lower, upper=upper), start, loss=loss, max_iterations=max_iterations,
            tolerance=1e-4, step_sd=0.03, gradient_sd=0.01, damping0=1e-3,
        )  # fmt: skip
    except NumericalError:
        return None


def _words(free: Free, far: tuple[float, float], quadratic: float, value: np.ndarray, on_box: tuple[bool, bool]) -> str:
    open_ends = []
    for side, one, end, box in zip(("below", "above"), far, value[[0, -1]], on_box, strict=True):
        if not np.isfinite(one):
            open_ends.append(f"open {side}: nothing speaks against {end:.3g}" + ", its bound" * bool(box))
    if open_ends:
        return "; ".join(open_ends)
    low, high = far
    if max(low, high) > ALIKE * min(low, high):
        longer, times = ("above", high / low) if high > low else ("below", low / high)
        return f"reaches {times:.2g} times further {longer} the value than the other way"
    ratio = 0.5 * (low + high) / quadratic
    if ratio > ALIKE or ratio < 1.0 / ALIKE:
        return f"{ratio:.2g} times as wide as the covariance says"
    return "agrees with the covariance"

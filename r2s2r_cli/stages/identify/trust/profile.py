"""Profile likelihood: one parameter held on a grid, everything else fitted again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.population import Cooling, Population, cool
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.covariance import Covariance
from r2s2r_cli.stages.identify.trust.held_at import HeldAt, PopulationHeldAt
from r2s2r_cli.stages.identify.trust.information import inverse, widths

ALIKE = 1.3
"""Ends of two intervals whose distances from the value differ by less than this factor are alike."""
FURTHER = (1.25, 1.6, 2.0)
"""Further points, in reaches, of a side on which the interval has not ended."""
LOWER = 0.02
"""Fall of the cost that a profile may find by chance of ending iterations early."""
LOWER_ROUGH = 0.5
"""The same, in inflations, between searches by populations: that of a point one standard deviation from the minimum."""
COOLER = 4.0
"""First temperature of such a search, in inflations: it begins near its end."""
GENERATIONS = 3
Search = Callable[[np.ndarray, float, int], tuple[np.ndarray, float]]
"""All unknowns and the cost with one of them held: from a start (n,), at a value, the how manyth of its side. Raises
NumericalError."""


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
    search: Search | None = None,
) -> Profile:
    """Of parameter `index`, on `points` values out to `reach` standard deviations or to its bounds.

    A side ends where the cost has risen twice as far as the interval needs, and goes on to twice the reach where it has
    not risen as far. Each point starts from its neighbour, moved as the normal matrix says the others follow. The rise
    at the ends of the interval is that which makes it equal to the covariance's on a linear problem, inflation included
    (plain profiles: Raue et al. 2009, Bioinformatics 25, 1923). Points that cannot be simulated end the grid.

    search: finds the others at a point; None: by derivatives. Where it is given, it finds them at the solution as well:
    a solution may be a mean, which is no minimum, and rises count from like to like.
    """
    free, z0 = frees[index], float(solution.z[index])
    variance, bread = float(spread.covariance[index, index]), float(spread.bread[index, index])
    known = np.isfinite(variance) and bread > 0
    sd = float(np.sqrt(variance)) if known else float(widths(problem, frees)[index])
    scale, quantile = variance / bread if known else spread.inflation, float(spread.quantile[index])
    threshold = 0.5 * scale * quantile**2
    near = np.arange(1, points // 2 + 1) / (points // 2)
    grid = sd * max(reach, 1.2 * quantile) * np.concatenate([near, FURTHER])
    middle = (solution.z, solution.cost) if search is None else search(solution.z, z0, 0)
    find = search or by_derivatives(problem, index, loss)
    sides = [_walk(problem, solution, middle, index, sign * grid, threshold, len(near), find) for sign in (-1.0, 1.0)]
    path = [*reversed(sides[0]), middle, *sides[1]]
    z, cost = np.array([one[index] for one, _ in path]), np.array([one for _, one in path])
    lowest = int(np.argmin(cost))
    chance = LOWER if search is None else LOWER_ROUGH * scale
    better = path[lowest][0] if cost[lowest] < middle[1] - chance else None
    rise = cost - (middle[1] if better is None and search is None else cost[lowest])
    low, high = interval(z, rise / scale, quantile)
    value = np.array([free.from_z(float(one)) for one in z])
    centre = z0 if better is None else float(better[index])
    on_box = bool(z[0] <= problem.lower[index]), bool(z[-1] >= problem.upper[index])
    words = _words((centre - low, high - centre), sd * quantile, value, on_box)
    if better is not None:
        words = f"a better fit was found at {free.from_z(centre):.4g}: {words}"
    lower, upper = (free.from_z(one) if np.isfinite(one) else np.nan for one in (low, high))
    return Profile(
        free.name, value, rise, threshold, lower, upper, (float(spread.lower[index]), float(spread.upper[index])),
        better, words,
    )  # fmt: skip


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


def by_derivatives(problem: Problem, index: int, loss: Loss, *, max_iterations: int = 4) -> Search:
    """Levenberg-Marquardt, for costs that are smooth."""

    def search(start: np.ndarray, at: float, number: int) -> tuple[np.ndarray, float]:
        found = levenberg_marquardt(
            HeldAt(problem, index, at), start, loss=loss, max_iterations=max_iterations, tolerance=1e-4, step_sd=0.03,
            gradient_sd=0.01, damping0=1e-3,
        )  # fmt: skip
        return found.z, found.cost

    return search


def by_population(
    problem: Population, solution: Solution, index: int, loss: Loss, *, members: int, inflation: float, seed: int
) -> Search:
    """Candidates about each point, as many as `members` in a generation, for costs that are rough."""
    cooling = Cooling(members, hottest=COOLER * inflation, coldest=inflation, generations=GENERATIONS)

    def search(start: np.ndarray, at: float, number: int) -> tuple[np.ndarray, float]:
        held = PopulationHeldAt(problem, index, at)
        found = cool(held, start, solution.normal, loss=loss, seed=1000 * seed + 100 * index + number, cooling=cooling)
        return found.z, found.cost

    return search


def _walk(
    problem: Problem, solution: Solution, middle: tuple[np.ndarray, float], index: int, offsets: np.ndarray,
    threshold: float, usual: int, find: Search,
) -> list[tuple[np.ndarray, float]]:  # fmt: skip
    """All unknowns and costs with one held at offsets from the middle, outwards; beyond the `usual` number of points
    only while the cost is below the threshold."""
    full = inverse(solution.normal)
    follow = full[:, index] / full[index, index] if full[index, index] > 0 else np.zeros(len(solution.z))
    follow[index] = 1.0
    found: list[tuple[np.ndarray, float]] = []
    z, cost = middle
    for k, offset in enumerate(offsets):
        at = float(np.clip(solution.z[index] + offset, problem.lower[index], problem.upper[index]))
        enough = 2.0 * threshold if k < usual else threshold
        if at == z[index] or cost > middle[1] + enough:
            break
        start = z + (at - z[index]) * follow
        start[index] = at
        try:
            z, cost = find(np.clip(start, problem.lower, problem.upper), at, k + 1)
        except NumericalError:
            break
        found.append((z, cost))
    return found


def _words(far: tuple[float, float], quadratic: float, value: np.ndarray, on_box: tuple[bool, bool]) -> str:
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

"""Laws of the winches fitted to ramps: rates by cable and way always beside them, each law alone against none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.series import persistence
from r2s2r_cli.stages.diagnose.parity.winch import Ramps, wound

LAWS: dict[str, tuple[str, tuple[float, ...]]] = {
    "latency": ("s", (-0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3)),
    "lag": ("s", (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4)),
    "play": ("m", (0.0, 0.0015, 0.003, 0.005, 0.007, 0.009, 0.012)),
    "sag": ("1/s", (-0.02, -0.01, 0.0, 0.01, 0.02, 0.04, 0.06)),
    "load": ("1", (-0.04, -0.02, 0.0, 0.02, 0.04, 0.06, 0.09)),
    "droop": ("1", (-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4)),
    "spool": ("1/m", (-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 5.0)),
}
"""Unit of each law's size, and sizes that are tried: the misfit is a parabola near the best of them."""
HUBER = 1.345


@dataclass(frozen=True)
class LawFit:
    """size, sd: of a law, in its unit. gain: by how much it lowers the misfit, in nats of a log likelihood."""

    law: str
    size: float
    sd: float
    gain: float


@dataclass(frozen=True)
class WinchFit:
    """rate, rate_sd: of every winch and way, in then out, [m/s], (actuated, 2). laws: each alone. sigma: of a reading
    about its ramp [m]. rows: how many independent ones."""

    rate: np.ndarray
    rate_sd: np.ndarray
    laws: dict[str, LawFit]
    sigma: float
    rows: float


def fit_winches(data: Ramps, winches: int, speed: float, *, given: dict[str, float] | None = None) -> WinchFit | None:
    """None where there are too few ramps. given: laws that hold in any case (those of healthy runs)."""
    if len(data) < 2 or len(data.length) < 4 * len(data):
        return None
    given = given or {}
    column = 2 * data.cable[data.ramp] + (data.way[data.ramp] < 0)
    plain = wound(data, given, speed)
    beta, rest, weight, normal = _solved(data, plain, column, winches, np.ones(len(data.length)))
    for _ in range(3):
        sigma = max(1.4826 * float(np.median(np.abs(rest))), 1e-9)
        weight = np.minimum(1.0, HUBER * sigma / np.maximum(np.abs(rest), 1e-12))
        beta, rest, weight, normal = _solved(data, plain, column, winches, weight)
    long = persistence(rest, data.ramp)
    rows = len(rest) / long
    variance = float(np.sum(weight * rest**2) / max(len(rest) - len(data) - (normal > 0).sum(), 1))
    count = np.bincount(2 * data.cable + (data.way < 0), minlength=2 * winches)
    scatter = _between(data, plain, rest, weight)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate_sd = np.sqrt(variance * long / np.maximum(normal, 1e-30) + scatter**2 / count)
        rate_sd = np.where(normal > 0, rate_sd, np.nan)
    rate = np.where(normal > 0, beta, np.nan)
    laws = {name: _law(data, name, given, speed, column, winches, weight, long) for name in LAWS}
    return WinchFit(rate.reshape(winches, 2), rate_sd.reshape(winches, 2), laws, float(np.sqrt(variance)), rows)


def _between(data: Ramps, path: np.ndarray, rest: np.ndarray, weight: np.ndarray) -> float:
    """By how much the rates of single ramps of a winch and way differ [m/s]: pulls and slack that no law here has."""
    x = path - (np.bincount(data.ramp, weight * path, len(data)) / np.bincount(data.ramp, weight, len(data)))[data.ramp]
    size = np.bincount(data.ramp, weight * x * x, len(data))
    own = np.bincount(data.ramp, weight * x * rest, len(data)) / np.maximum(size, 1e-30)
    return 1.4826 * float(np.median(np.abs(own)))


def _law(
    data: Ramps, name: str, given: dict[str, float], speed: float, column: np.ndarray, winches: int, weight: np.ndarray,
    long: float,
) -> LawFit:  # fmt: skip
    """The size of one law at which the misfit is least."""

    def cost(size: float) -> float:
        path = wound(data, {**given, name: size}, speed)
        _, rest, _, _ = _solved(data, path, column, winches, weight)
        return float(np.sum(weight * rest**2))

    sizes = sorted({*LAWS[name][1], given.get(name, 0.0)})
    costs = [cost(size) for size in sizes]
    best = int(np.argmin(costs))
    low, high = max(best - 1, 0), min(best + 1, len(sizes) - 1)
    a, b = sizes[low], sizes[high]
    for _ in range(8):  # golden section: the misfit bends sharply where a law switches
        first, second = b - 0.618 * (b - a), a + 0.618 * (b - a)
        a, b = (a, second) if cost(first) < cost(second) else (first, b)
    size = (a + b) / 2
    least = cost(size)
    if costs[best] < least:
        size, least = sizes[best], costs[best]
    rows = len(data.length)
    gain = 0.5 * rows / long * np.log(max(costs[sizes.index(given.get(name, 0.0))], 1e-30) / max(least, 1e-30))
    width = 0.1 * (LAWS[name][1][-1] - LAWS[name][1][0])

    def residual(size: float) -> np.ndarray:
        return _solved(data, wound(data, {**given, name: size}, speed), column, winches, weight)[1]

    # Every ramp has errors of its own (White's variance with clusters, Liang and Zeger 1986).
    here = residual(size)
    slope = (residual(size + width) - here) / width
    bend = float(np.sum(weight * slope**2))
    score = np.bincount(data.ramp, weight * slope * here, len(data))
    count = len(data)
    alone = float(np.sum(score**2)) * count / max(count - 1, 1)
    sd = float(np.sqrt(max(alone, bend * least / rows * long)) / bend) if bend > 0 else float("inf")
    return LawFit(name, float(size), sd, float(max(gain, 0.0)))


def _solved(
    data: Ramps, path: np.ndarray, column: np.ndarray, winches: int, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rates (2 actuated,), residuals (row,), weights and curvature by rate: every ramp has an offset of its own, and a
    rate is of one winch and way, so that all sums are by ramp and column."""
    count = len(data)
    total = np.maximum(np.bincount(data.ramp, weight, count), 1e-30)

    def centred(x: np.ndarray) -> np.ndarray:
        return np.asarray(x - (np.bincount(data.ramp, weight * x, count) / total)[data.ramp])

    x, y = -centred(path), centred(data.length)
    normal = np.bincount(column, weight * x * x, 2 * winches)
    beta = np.bincount(column, weight * x * y, 2 * winches) / np.maximum(normal, 1e-30)
    return beta, y - beta[column] * x, weight, normal

"""Force-displacement curves of the passive tendons: a cubic through the origin per curve, and their average.

Paper, "Offline Robot Measurements": 11 tendons on a materials testing machine, a third-order polynomial fit to each
curve, the average used in the simulator.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.source import Column, Source, read_table
from schemas.robot import Robot

EXAMPLE = "curve,displacement_mm,force_N"
_COLUMNS = (
    Column("curve", {"curve": 1}, kind="text", required=False),
    Column("displacement", {"displacement_mm": 1e-3, "displacement_m": 1.0}),
    Column("force", {"force_N": 1.0}),
)

MIN_DISPLACEMENTS = 4
"""Different displacements above zero: one more than the cubic has coefficients."""

ZERO_FORCE = 0.05
"""Largest negative force, as a share of the largest force, that passes for the noise of an unloaded load cell."""

MIN_STRETCH_M = 1e-3
"""A curve that ends below 1 mm is no tendon test: the unit is wrong."""

MAX_FORCE_N = 1e5
"""The weight of 10 t: such a number is not a force in newtons."""

GRID = 101
"""Points of the band."""


@dataclass(frozen=True)
class Curve:
    """One measured curve: displacement [m] and force [N], shape (point,), displacement never decreasing."""

    name: str
    displacement: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class CurveFit:
    """force [N] = k1 x + k2 x^2 + k3 x^3 with `k` = (k1 [N/m], k2 [N/m^2], k3 [N/m^3]); `rms` [N].

    `stiffness_min` [N/m]: smallest slope of the fit on 0..x_max; `monotone`: it is positive.
    """

    name: str
    k: np.ndarray
    rms: float
    x_max: float
    stiffness_min: float
    monotone: bool


@dataclass(frozen=True)
class Average:
    """Mean and spread of the fits. `k`, `k_sd`: shape (3,), units as in CurveFit. `x`, `mean`, `sd`: the band,
    shape (grid,), [m], [N], [N], on 0..x_common, the range that every curve covers. NaN spread for one curve."""

    k: np.ndarray
    k_sd: np.ndarray
    x: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    x_common: float
    stiffness_min: float
    monotone: bool


def read_curves(sources: Sequence[Source], robot: Robot) -> tuple[Curve, ...]:
    """Read one or many curves from one or many files. A file without a `curve` column is one curve, named by its stem.

    Raises InputError: too few points, falling displacement, forces below zero, a displacement that no cable has.
    """
    curves: dict[str, Curve] = {}
    for source in sources:
        table = read_table(source, _COLUMNS, EXAMPLE)
        names = table.values.get("curve", (source.stem,) * len(table.lines))
        x, force = (np.array(table.values[name], dtype=np.float64) for name in ("displacement", "force"))
        lines = np.array(table.lines)
        for name in dict.fromkeys(str(name) for name in names):
            rows = np.array([str(other) == name for other in names])
            if name in curves:
                raise InputError(
                    "two files hold a curve of the same name", where=source.name, expected="each curve once",
                    received=f"{name} again", hint="rename one of the files, or its curve",
                )  # fmt: skip
            curves[name] = Curve(name, x[rows], force[rows])
            _check(curves[name], f"{source.name}, curve {name}", lines[rows], robot)
    return tuple(curves.values())


def fit_curve(curve: Curve) -> CurveFit:
    """Least squares for k1, k2, k3; zero force at zero displacement holds exactly.

    Dropping the constant drops it at the middle of the fit's domain, so the domain is -x_max..x_max.
    """
    x_max = float(curve.displacement.max())
    fit = Polynomial.fit(curve.displacement, curve.force, deg=[1, 2, 3], domain=[-x_max, x_max])
    k = np.zeros(3)
    coefficients = fit.convert().coef[1:]
    k[: len(coefficients)] = coefficients
    residual = curve.force - force_of(k, curve.displacement)
    lowest = stiffness_min(k, x_max)
    return CurveFit(curve.name, k, float(np.sqrt(np.mean(residual**2))), x_max, lowest, lowest > 0)


def average(fits: Sequence[CurveFit]) -> Average:
    """Mean of the coefficients, and the pointwise mean and standard deviation of the fitted curves.

    The mean of the curves is the curve of the mean coefficients, since the force is linear in them.
    """
    ks = np.stack([fit.k for fit in fits])
    x_common = min(fit.x_max for fit in fits)
    x = np.linspace(0.0, x_common, GRID)
    forces = np.stack([force_of(fit.k, x) for fit in fits])
    k = ks.mean(axis=0)
    one = len(fits) == 1
    lowest = stiffness_min(k, x_common)
    return Average(
        k=k,
        k_sd=np.full(3, np.nan) if one else ks.std(axis=0, ddof=1),
        x=x,
        mean=force_of(k, x),
        sd=np.full(GRID, np.nan) if one else forces.std(axis=0, ddof=1),
        x_common=x_common,
        stiffness_min=lowest,
        monotone=lowest > 0,
    )


def force_of(k: np.ndarray, x: np.ndarray) -> np.ndarray:
    """k1 x + k2 x^2 + k3 x^3 [N] at x [m]."""
    return x * (k[0] + x * (k[1] + x * k[2]))


def stiffness_min(k: np.ndarray | Sequence[float], x_max: float) -> float:
    """Smallest slope k1 + 2 k2 x + 3 k3 x^2 [N/m] on 0..x_max: at an end or at the vertex -k2 / (3 k3)."""
    k1, k2, k3 = (float(value) for value in k)
    at = [0.0, x_max]
    if 0 < -k2 < 3 * k3 * x_max:
        at.append(-k2 / (3 * k3))
    return min(k1 + x * (2 * k2 + 3 * k3 * x) for x in at)


def falls_from(k: np.ndarray) -> float:
    """First displacement [m], beyond zero, from which the force of the cubic falls; infinity if it never does.

    The smallest positive root of the derivative at which the slope goes from plus to minus (0 if it starts below zero).
    The roots are q / (3 k3) and k1 / q with q = -k2 -+ sqrt(k2^2 - 3 k1 k3): exact also where k3 is all but zero.
    """
    k1, k2, k3 = (float(value) for value in k)
    if k1 < 0 or (k1 == 0 and (k2 < 0 or (k2 == 0 and k3 < 0))):
        return 0.0
    inside = k2**2 - 3 * k1 * k3
    if inside < 0:
        return math.inf
    q = -k2 - math.copysign(math.sqrt(inside), k2)
    roots = [top / bottom for top, bottom in ((q, 3 * k3), (k1, q)) if bottom != 0]
    return min((x for x in roots if x > 0 and k2 + 3 * k3 * x < 0), default=math.inf)


def _check(curve: Curve, where: str, lines: np.ndarray, robot: Robot) -> None:
    x, force = curve.displacement, curve.force
    if (x < 0).any():
        row = int(np.argmin(x))
        raise InputError(
            "a displacement below zero", where=f"{where}, line {lines[row]}", expected="stretch beyond the rest length",
            received=f"{1e3 * x[row]:.6g} mm", hint="subtract the displacement at which the tendon becomes taut",
        )  # fmt: skip
    if (np.diff(x) < 0).any():
        row = int(np.argmax(np.diff(x) < 0)) + 1
        raise InputError(
            "the displacement decreases within a curve", where=f"{where}, line {lines[row]}",
            expected="one pull, from slack to stretched",
            received=f"{1e3 * x[row]:.6g} mm after {1e3 * x[row - 1]:.6g} mm",
            hint="keep the loading branch, or give every pull a curve name of its own",
        )  # fmt: skip
    distinct = len(np.unique(x[x > 0]))
    if distinct < MIN_DISPLACEMENTS:
        raise InputError(
            "too few points for a cubic", where=where, received=f"{distinct}",
            expected=f"{MIN_DISPLACEMENTS} different displacements above zero or more",
            hint="measure more points of the curve",
        )  # fmt: skip
    longest = robot.limits.cable_length_max_m * 10**0.5
    if not MIN_STRETCH_M <= x.max() <= longest:
        raise InputError(
            "a stretch that no cable of this robot can have", where=where,
            expected=f"an end between {1e3 * MIN_STRETCH_M:g} and {1e3 * longest:.0f} mm",
            received=f"{1e3 * x.max():.6g} mm", hint="name the column by its unit, displacement_mm or displacement_m",
        )  # fmt: skip
    if np.abs(force).max() > MAX_FORCE_N:
        row = int(np.argmax(np.abs(force)))
        raise InputError(
            "a force that no tendon bears", where=f"{where}, line {lines[row]}", expected=f"up to {MAX_FORCE_N:g} N",
            received=f"{force[row]:.6g} N", hint="give the force in newtons",
        )  # fmt: skip
    if force.max() <= 0 or force.min() < -ZERO_FORCE * force.max():
        row = int(np.argmin(force))
        raise InputError(
            "a tendon that pushes", where=f"{where}, line {lines[row]}", expected="tension as positive force",
            received=f"{force[row]:.6g} N", hint="turn the sign of the force, and zero the load cell",
        )  # fmt: skip

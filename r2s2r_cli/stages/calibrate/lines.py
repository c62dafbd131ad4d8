"""A straight line through (length, capacitance), judged by the lengths that it would read back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RESOLUTION_F = 1e-14
"""0.01 pF: the last digit that the boards send. A capacitance that moves less over the whole range is dead."""

CONFIDENCE = 0.95
"""Two-sided, of the test whether the slope differs from zero. With five points it must be 3.2 standard errors."""

MIN_LENGTHS = 3
"""Different lengths needed: two always lie on a line, and leaving one out must leave two."""

MIN_LENGTHS_QUADRATIC = 5
"""Different lengths needed for a parabola to mean something: two degrees of freedom are left."""

GOOD, DEAD, FALLING = 0, 1, 2


@dataclass(frozen=True)
class LineFit:
    """capacitance [F] = slope [F/m] length [m] + offset [F], with residuals in length [m], shape (point,).

    `rms`, `worst`, `loo_rms`, `quadratic_rms` [m] and the residuals are NaN where `state` is DEAD; `quadratic_rms`
    also with fewer than MIN_LENGTHS_QUADRATIC different lengths. `state`: code of schemas.calibration.LINE_STATES.
    """

    slope: float
    slope_se: float
    offset: float
    residual: np.ndarray
    loo_residual: np.ndarray
    rms: float
    worst: float
    loo_rms: float
    quadratic_rms: float
    state: int

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.residual)


def fit_line(length: np.ndarray, capacitance: np.ndarray) -> LineFit:
    """Least squares of the capacitance on the length; residuals in length of the inverted line.

    The length is set with a rule or a jig, the capacitance is read: the errors are in the capacitance, so that is
    what is regressed, as the robot's makers do (calibration, Johnson 2021). The robot then reads lengths,
    (C - offset) / slope, hence residual_i = (C_i - offset) / slope - L_i, and rms = sqrt(mean residual^2),
    without a correction for the two fitted numbers (`loo_rms` is the honest forecast).

    Leave-one-out in closed form: without point i the line misses C_i by e_i / (1 - h_i), and its slope is
    slope - (L_i - mean L) e_i / (S (1 - h_i)), with e the residuals in capacitance, S = sum (L - mean L)^2 and
    h_i = 1/n + (L_i - mean L)^2 / S.

    length [m], capacitance [F]: shape (point,), with at least MIN_LENGTHS different lengths (the caller checks).
    """
    n = len(length)
    centred = length - length.mean()
    total = float(centred @ centred)
    slope = float(centred @ capacitance) / total
    offset = float(capacitance.mean()) - slope * float(length.mean())
    error = capacitance - (slope * length + offset)
    slope_se = float(np.sqrt(error @ error / (n - 2) / total))
    state = _state(slope, slope_se, n, float(np.ptp(length)))
    if state == DEAD:
        nan = np.full(n, np.nan)
        return LineFit(slope, slope_se, offset, nan, nan, np.nan, np.nan, np.nan, np.nan, state)

    residual = error / slope
    left = error / (1 - 1 / n - centred**2 / total)
    loo = left / (slope - centred * left / total)
    return LineFit(
        slope=slope,
        slope_se=slope_se,
        offset=offset,
        residual=residual,
        loo_residual=loo,
        rms=rms(residual),
        worst=float(np.abs(residual).max()),
        loo_rms=rms(loo),
        quadratic_rms=_quadratic_rms(centred, error, slope),
        state=state,
    )


def rms(values: np.ndarray) -> float:
    """Square root of the mean square; NaN for none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _state(slope: float, slope_se: float, n: int, span: float) -> int:
    from scipy.special import stdtrit

    certain = stdtrit(n - 2, 0.5 + CONFIDENCE / 2) * slope_se
    if abs(slope) <= certain or abs(slope) * span < RESOLUTION_F:
        return DEAD
    return GOOD if slope > 0 else FALLING


def _quadratic_rms(centred: np.ndarray, error: np.ndarray, slope: float) -> float:
    """Rms of what a parabola leaves, over the line's slope: how much of the residual is curvature (advice only)."""
    if len(np.unique(centred)) < MIN_LENGTHS_QUADRATIC:
        return float("nan")
    # The residual of the line is orthogonal to 1 and L, so only the part of L^2 orthogonal to both can reduce it.
    basis = np.stack([np.ones_like(centred), centred], axis=1)
    square = centred**2
    bend = square - basis @ np.linalg.lstsq(basis, square, rcond=None)[0]
    return rms((error - bend * float(bend @ error) / float(bend @ bend)) / slope)

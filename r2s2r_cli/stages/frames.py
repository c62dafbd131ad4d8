"""Frames of end-cap observations: which are kept, how noisy they are, and what they say about rods and ground."""

from __future__ import annotations

from math import erf, exp, pi, sqrt

import numpy as np

KEPT, DUPLICATE, BACKWARDS, NOT_FINITE = 0, 1, 2, 3
"""Codes of `drop_reason`, as in `schemas.recording.DROP_REASONS`."""

MIN_GAP_S = 0.020
"""Two frames closer than this are one observation stamped twice."""
_STAMP_ROUNDING_S = 1e-6
"""Logs round stamps to milliseconds: a gap written as 0.020 must not fall below 20 ms by binary rounding."""

WINDOW = 5
"""Frames of one local line."""
_CUT = 7.8147
"""95 % quantile of chi-square with the WINDOW - 2 degrees of freedom that a straight line leaves: windows beyond it are
taken for motion."""
_MEDIAN = 2.3660
"""Median of the same chi-square."""
_MAX_ITERATIONS = 100

GAP_FACTOR = 5.0
"""A hole is longer than this many median gaps."""


def keep_frames(t: np.ndarray, p_WE: np.ndarray | None = None) -> np.ndarray:
    """Why each frame is left out of everything later: 0 kept, else a code of DROP_REASONS.

    t: stamps [s], shape (frame,). p_WE: end caps [m], shape (frame, cap, xyz), world frame; None for streams
    without caps. A frame is compared with the last *kept* one, so that a burst of close stamps leaves one frame
    every 20 ms and not none. An unobserved frame never hides a good one. Returns uint8, shape (frame,).
    """
    finite = np.isfinite(t)
    if p_WE is not None:
        finite &= np.isfinite(p_WE).all(axis=(1, 2))
    reason = np.where(finite, KEPT, NOT_FINITE).astype(np.uint8)
    last = -np.inf
    for i in np.flatnonzero(finite).tolist():
        gap = float(t[i]) - last
        if gap < 0:
            reason[i] = BACKWARDS
        elif gap < MIN_GAP_S - _STAMP_ROUNDING_S:
            reason[i] = DUPLICATE
        else:
            last = float(t[i])
    return reason


def in_order(t: np.ndarray, reason: np.ndarray) -> np.ndarray:
    """Frames whose stamps rise strictly: all kept ones, and others that lie between their kept neighbours.

    t: stamps [s]; reason: of `keep_frames`; both of shape (frame,). A frame dropped for its caps still carries
    commands and lengths. Returns bool, shape (frame,).
    """
    kept = reason == KEPT
    following = np.minimum.accumulate(np.where(kept, t, np.inf)[::-1])[::-1]
    rows = kept.copy()
    last = -np.inf
    for i in range(len(t)):
        if kept[i] or (reason[i] != BACKWARDS and last < t[i] < following[i]):
            rows[i], last = True, float(t[i])
    return rows


def noise_sd(t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
    """Noise of the observations per cap and axis [m], shape (cap, xyz), world frame.

    t: stamps of the kept frames [s], strictly increasing, shape (frame,). p_WE: their end caps [m],
    shape (frame, cap, xyz). NaN with fewer than 5 frames.

    A line is fitted to every 5 consecutive frames by least squares over their true stamps. White noise of variance
    s^2 leaves the residual sum RSS = s^2 chi2(3) whatever the stamps are, because the residual maker I - H of a line
    has trace 5 - 2 for any 5 distinct stamps; no correction for irregular stamps is needed, and RSS / 5 would be
    too small by 40 %. A bend of acceleration a adds 14 (a dt^2 / 2)^2 to RSS.

    Tip-overs and jumps make some windows far too large. They are rejected by a truncated mean made consistent:
    start at median(RSS) / 2.366, keep windows with RSS <= q s^2 (q = 7.81, the 95 % point), and solve
    s^2 = mean(kept RSS) / E[chi2 | chi2 <= q] by iteration. A quarter of the windows broken by jumps moves the
    result by about 1 %, the plain mean by 150 % (`tests/stages/test_frames.py`). More than half broken: no longer.
    """
    if len(t) < WINDOW:
        return np.full(p_WE.shape[1:], np.nan)
    rss = _window_residuals(t, p_WE)
    expected = _truncated_mean(_CUT)
    variance = np.median(rss, axis=0) / _MEDIAN
    for _ in range(_MAX_ITERATIONS):
        inside = rss <= _CUT * variance
        renewed = np.where(inside, rss, 0.0).sum(axis=0) / np.maximum(inside.sum(axis=0), 1) / expected
        if np.allclose(renewed, variance, rtol=1e-6, atol=0.0):
            break
        variance = renewed
    return np.sqrt(variance)


def _window_residuals(t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
    """Residual sum of squares of the line through each 5 consecutive frames [m^2], shape (window, cap, xyz)."""
    windows = np.lib.stride_tricks.sliding_window_view
    dt = windows(t, WINDOW)
    dt = dt - dt.mean(axis=1, keepdims=True)
    dp = windows(p_WE, WINDOW, axis=0)
    dp = dp - dp.mean(axis=-1, keepdims=True)
    dt = dt[:, None, None, :]
    slope = (dp * dt).sum(axis=-1, keepdims=True) / (dt * dt).sum(axis=-1, keepdims=True)
    return ((dp - slope * dt) ** 2).sum(axis=-1)


def _truncated_mean(q: float) -> float:
    """E[X | X <= q] of X ~ chi2(3): 3 F_5(q) / F_3(q), with F_5(q) = F_3(q) - (q/2)^1.5 exp(-q/2) / Gamma(2.5)."""
    f3 = erf(sqrt(q / 2)) - sqrt(2 * q / pi) * exp(-q / 2)
    f5 = f3 - (q / 2) ** 1.5 * exp(-q / 2) / (0.75 * sqrt(pi))
    return 3 * f5 / f3


def fit_rod_length(p_WE: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length of each rod [m] and the standard deviation of its frames [m], both of shape (rod,).

    p_WE: end caps of the kept frames [m], shape (frame, cap, xyz); caps 2 i and 2 i + 1 lie on rod i. The length is
    the median over frames, so that a lost cap does not move it; the deviation is the plain one and shows it.
    """
    length = np.linalg.norm(p_WE[:, 1::2] - p_WE[:, 0::2], axis=-1)
    return np.median(length, axis=0), np.std(length, axis=0)


def ground_offset(p_WE: np.ndarray, cap_radius: float | np.ndarray) -> float:
    """What to add to z so that the robot stands on z = 0: cap radius minus mean height of the lowest cap [m].

    p_WE: end caps of the kept frames [m], shape (frame, cap, xyz), world frame. cap_radius [m]: one for all, or
    shape (cap,). The minimum over caps of a noisy height lies below the true one (by about 0.8 sd for three caps on
    the ground), so the offset is an upper estimate; `estimate` refines it with the contacts.
    """
    lowest = (p_WE[:, :, 2] - cap_radius).min(axis=1)
    return float(-lowest.mean())


def stamp_jitter(t: np.ndarray) -> float:
    """Standard deviation of the gaps between kept frames [s]; NaN with fewer than 3 frames."""
    return float(np.std(np.diff(t))) if len(t) > 2 else float("nan")


def in_hole(t: np.ndarray) -> np.ndarray:
    """Whether a hole lies before each kept frame, (frame,); never before the first. t: stamps [s], (frame,)."""
    gap = np.diff(t, prepend=t[:1])
    return np.asarray(gap > GAP_FACTOR * np.median(gap[1:])) if len(t) > 2 else np.zeros(len(t), dtype=bool)


def holes(t: np.ndarray) -> list[tuple[float, float]]:
    """Holes in kept stamps t [s]: (time before the hole, its length), the longest first."""
    found = np.flatnonzero(in_hole(t)) - 1
    return sorted(((float(t[i]), float(t[i + 1] - t[i])) for i in found), key=lambda hole: -hole[1])

"""What could be closed at all: errors at key frames predicted from the commands, by a ridge regression that knows no
physics. It stands for the residual networks of other tools."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.stretches import Stretch

RIDGES = (0.1, 1.0, 10.0, 100.0, 1e3)


def corrected(
    fitted: Sequence[Stretch], errors: np.ndarray, judged: Sequence[Stretch], judged_errors: np.ndarray
) -> np.ndarray:
    """Judged errors (segment, cap, 3) [m] less what is predicted of them, learned from the fitted ones.

    Features: targets before and during the interval. Errors are turned into the robot's own heading at the start. The
    strength of the ridge is that which predicts fitted segments best when they are left out.
    """
    X, Y = _features(fitted), _turned(fitted, errors, back=False)
    known = np.isfinite(Y).all(axis=1)
    X, Y = X[known], Y[known]
    if len(X) < 3:
        return judged_errors
    best = min(RIDGES, key=lambda ridge: _left_out(X, Y, ridge))
    mean_x, mean_y = X.mean(axis=0), Y.mean(axis=0)
    if _left_out(X, Y, best) >= float(np.mean(Y**2)):
        return judged_errors  # it predicts nothing: no correction is the better black box
    W = _weights(X - mean_x, Y - mean_y, best)
    predicted = (_features(judged) - mean_x) @ W + mean_y
    return judged_errors - _turned(judged, predicted.reshape(judged_errors.shape), back=True).reshape(
        judged_errors.shape
    )


def _features(many: Sequence[Stretch]) -> np.ndarray:
    rows = []
    for one in many:
        target = one.window.run.intervals.target
        now = target[one.interval - 1]
        before = target[one.interval - 2] if one.interval > 1 else np.ones_like(now)
        rows.append(np.concatenate([now - before, before]))
    return np.nan_to_num(np.array(rows))


def _turned(many: Sequence[Stretch], errors: np.ndarray, *, back: bool) -> np.ndarray:
    """Errors in the robot's heading (from cap 0 to the middle of all), or from there back, (segment, 3 cap)."""
    found = []
    for one, error in zip(many, errors, strict=True):
        p = one.window.run.observed[0]
        way = p.mean(axis=0) - p[0]
        angle = np.arctan2(way[1], way[0]) * (1.0 if back else -1.0)
        c, s = np.cos(angle), np.sin(angle)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        found.append((error @ R.T).ravel())
    return np.array(found)


def _weights(X: np.ndarray, Y: np.ndarray, ridge: float) -> np.ndarray:
    return np.asarray(np.linalg.solve(X.T @ X + ridge * np.eye(X.shape[1]), X.T @ Y))


def _left_out(X: np.ndarray, Y: np.ndarray, ridge: float) -> float:
    """Mean squared error of leaving one segment out."""
    total = 0.0
    for i in range(len(X)):
        keep = np.arange(len(X)) != i
        mx, my = X[keep].mean(axis=0), Y[keep].mean(axis=0)
        W = _weights(X[keep] - mx, Y[keep] - my, ridge)
        total += float(np.mean((Y[i] - my - (X[i] - mx) @ W) ** 2))
    return total / len(X)

"""Least squares over a chain of frames: elimination forward, states and covariances backward.

The normal equations of a run whose frames are coupled with their neighbours only are block tridiagonal. Their
elimination is the Kalman filter, their back substitution the Rauch-Tung-Striebel smoother, both in information form
(Rauch, Tung and Striebel 1965; for the equality Bell, SIAM J. Optim. 4 (1994) 626): one Gauss-Newton step of the whole
run is one iterated extended Kalman smoother.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError


@dataclass(frozen=True)
class Normal:
    """H dx = -g. diagonal: (frame, dim, dim); upper: H of frames k, k + 1, (frame - 1, dim, dim); g: (frame, dim)."""

    diagonal: np.ndarray
    upper: np.ndarray
    gradient: np.ndarray


@dataclass(frozen=True)
class Eliminated:
    """factor: Cholesky factors (upper) of what is left of the diagonal, (frame, dim, dim); back: gains of the smoother,
    x_k = step_k - back_k x_{k+1}, (frame - 1, dim, dim); step: (frame, dim)."""

    factor: np.ndarray
    back: np.ndarray
    step: np.ndarray


@dataclass(frozen=True)
class Marginals:
    """Covariances of single frames (frame, dim, dim), and between a frame and the next (frame - 1, dim, dim)."""

    cov: np.ndarray
    cross: np.ndarray


def eliminate(normal: Normal) -> Eliminated:
    """Forward pass. Raises NumericalError where the equations do not determine the states."""
    from scipy.linalg.lapack import dpotrf, dpotrs

    n, dim, _ = normal.diagonal.shape
    factor, back, step = np.empty((n, dim, dim)), np.empty((n - 1, dim, dim)), np.empty((n, dim))
    left, right = normal.diagonal[0], -normal.gradient[0]
    for k in range(n):
        factor[k], failed = dpotrf(left)
        if failed or not np.isfinite(factor[k, -1, -1]):
            raise NumericalError(
                "the tracked motion is not determined", where=f"frame {k}", expected="positive definite equations",
                received="a state that nothing observes",
                hint="r2s2r inspect 10-record.h5   # check the stamps and covariances of the sightings",
            )  # fmt: skip
        step[k] = dpotrs(factor[k], right)[0]
        if k + 1 < n:
            upper = normal.upper[k]
            back[k] = dpotrs(factor[k], upper)[0]
            left = normal.diagonal[k + 1] - upper.T @ back[k]
            right = -normal.gradient[k + 1] - upper.T @ step[k]
    return Eliminated(factor, back, step)


def substitute(done: Eliminated) -> np.ndarray:
    """The solution dx, shape (frame, dim)."""
    x = done.step.copy()
    for k in range(len(x) - 2, -1, -1):
        x[k] -= done.back[k] @ x[k + 1]
    return x


def marginals(done: Eliminated) -> Marginals:
    """Covariances of the solution."""
    from scipy.linalg.lapack import dpotri

    n, dim = done.step.shape
    cov, cross = np.empty((n, dim, dim)), np.empty((n - 1, dim, dim))
    lower = np.tril_indices(dim, -1)
    for k in range(n - 1, -1, -1):
        own = dpotri(done.factor[k])[0]
        own[lower] = own.T[lower]
        if k + 1 < n:
            cross[k] = -done.back[k] @ cov[k + 1]
            own -= cross[k] @ done.back[k].T
        cov[k] = 0.5 * (own + own.T)
    return Marginals(cov, cross)

"""Jacobians by central differences, for residuals without derivatives: closed-loop runs, where time itself jumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError


@dataclass(frozen=True)
class Secant:
    """A Jacobian (m, n) and the residual (m,) at the same point.

    width: (n,), the one that was used. rough: (n,), difference of the forward and the backward quotient as a share of
    their sum: near 0 where the function is smooth, 1 where one side says nothing, nan where only one side is known.
    """

    jacobian: np.ndarray
    residual: np.ndarray
    width: np.ndarray
    rough: np.ndarray


def secant_jacobian(
    f_batch: Callable[[np.ndarray], np.ndarray],
    z: np.ndarray,
    widths: tuple[float | np.ndarray, float | np.ndarray],
    *,
    lower: np.ndarray | float = -np.inf,
    upper: np.ndarray | float = np.inf,
) -> Secant:
    """Central quotients of f at z (n,) in two widths, one number or (n,) each; a column takes the smoother of the two.

    Smoother is where forward and backward quotient differ less, relative to their size. That difference grows with the
    width by the curvature of f, and falls with it where f jumps (a switch of contact, a motor that stops one frame
    later), so neither width has to be right for all unknowns. Beyond the box nothing is evaluated: there, and where a
    row of f is not finite, the quotient is one-sided.

    f_batch: (k, n) -> (k, m), called once with k <= 4 n + 1 points; nan in a row that cannot be evaluated.
    Raises NumericalError where f(z), or both sides in both widths of an unknown, cannot be evaluated.
    """
    z = np.asarray(z, dtype=float)
    n = len(z)
    offset = np.stack([np.broadcast_to(np.asarray(width, dtype=float), (n,)) for width in widths])
    points = np.tile(z, (2, 2, n, 1))  # width, side, unknown
    for side, sign in enumerate((1.0, -1.0)):
        points[:, side, np.arange(n), np.arange(n)] += sign * offset
    moves = np.einsum("wsii->wsi", points) - z  # what is left of the offset after rounding
    inside = np.all((points >= lower) & (points <= upper), axis=-1)
    answers = np.asarray(f_batch(np.vstack([z[None], points[inside]])))
    residual = answers[0]
    if not np.all(np.isfinite(residual)):
        raise _failed("the residuals are not finite where differences are taken", str(np.round(z, 6).tolist()))
    values = np.full((2, 2, n, len(residual)), np.nan)
    values[inside] = answers[1:]
    quotient = (values - residual) / moves[..., None]
    known = np.all(np.isfinite(quotient), axis=-1)
    jacobian, rough, used = np.zeros((len(residual), n)), np.full(n, np.nan), np.zeros(n)
    for i in range(n):
        both = [w for w in range(2) if known[w, :, i].all()]
        if both:
            shares = [_rough(quotient[w, 0, i], quotient[w, 1, i]) for w in both]
            w = both[int(np.argmin(shares))]
            rough[i] = min(shares)
            jacobian[:, i] = (values[w, 0, i] - values[w, 1, i]) / (moves[w, 0, i] - moves[w, 1, i])
        elif known[:, :, i].any():
            w, side = np.argwhere(known[:, :, i])[0]
            jacobian[:, i] = quotient[w, side, i]
        else:
            raise _failed("no difference can be taken: both sides are outside or not finite", f"unknown {i}")
        used[i] = offset[w, i]
    return Secant(jacobian, residual, used, rough)


def _rough(forward: np.ndarray, backward: np.ndarray) -> float:
    size = float(np.linalg.norm(forward) + np.linalg.norm(backward))
    return float(np.linalg.norm(forward - backward)) / size if size > 0 else 0.0


def _failed(what: str, where: str) -> NumericalError:
    return NumericalError(what, where=where, hint="smaller widths, or a start further inside: r2s2r identify --help")

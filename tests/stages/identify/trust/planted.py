"""Problems with a known truth in the form that fits take: linear ones with windows, and free parameters for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.solve.record import Counts, Reason, Solution
from tests.stages.identify.solve.problems import Formula, formula


def linear_frees(names: tuple[str, ...], half: float = 1e3) -> tuple[Free, ...]:
    """Free numbers of either sign."""
    return tuple(Free(name, "m", 0.0, -half, half, Coordinate.LINEAR) for name in names)


@dataclass(frozen=True)
class Planted:
    """A linear problem of windows with offsets of their own, and its truth. cluster: window of each residual."""

    problem: Formula
    truth: np.ndarray
    cluster: np.ndarray
    matrix: np.ndarray
    frees: tuple[Free, ...]


def planted(seed: int, *, windows: int = 7, rows: int = 40, p: int = 4, offsets: int = 3, shared: float = 0.0,
            noise: float = 1.0) -> Planted:  # fmt: skip
    """y = A x + B_w n_w + shared * A m_w + noise * e: offsets n_w from their priors, m_w misfits of windows."""
    draw = np.random.default_rng(seed)
    cluster = np.repeat(np.arange(windows), rows)
    n = p + windows * offsets
    matrix = np.zeros((len(cluster), n))
    matrix[:, :p] = draw.normal(size=(len(cluster), p)) + draw.normal(size=(windows, p))[cluster]
    for w in range(windows):
        matrix[cluster == w, p + w * offsets : p + (w + 1) * offsets] = 0.5 + draw.normal(size=(rows, offsets))
    sd = np.concatenate([np.full(p, np.inf), np.full(windows * offsets, 0.5)])
    truth = np.concatenate([draw.normal(size=p), 0.5 * draw.normal(size=windows * offsets)])
    misfit = shared * np.sum(matrix[:, :p] * draw.normal(size=(windows, p))[cluster], axis=1)
    y = matrix @ truth + misfit + noise * draw.normal(size=len(cluster))
    names = tuple(f"x{k}" for k in range(p))
    problem = formula(lambda z: matrix @ z - y, lambda z: matrix, n, prior_sd=sd, names=names)
    return Planted(problem, truth[:p], cluster, matrix, linear_frees(names))


def solved(problem: Formula, z: np.ndarray | None = None) -> Solution:
    """The least squares solution of a linear problem, by its normal equations, or what a fit would say at z."""
    n = len(problem.lower)
    origin = problem.evaluate(np.zeros(n) if z is None else z)
    jacobian, precision = origin.jacobian, np.asarray(problem.prior_sd) ** -2.0
    normal = jacobian.T @ jacobian + np.diag(precision)
    if z is None:
        z = np.linalg.lstsq(normal, precision * problem.prior_mean - jacobian.T @ origin.residual, rcond=None)[0]
    residual = problem.evaluate(z, jacobian=False).residual
    pull = precision * (z - problem.prior_mean)
    cost = 0.5 * float(residual @ residual + pull @ (z - problem.prior_mean))
    return Solution(
        z=z, cost=cost, costs=(cost,), residual=residual, jacobian=jacobian, weight=np.ones(len(residual)),
        normal_data=jacobian.T @ jacobian, normal=normal, gradient=jacobian.T @ residual + pull, reason=Reason.GRADIENT,
        iterations=1, counts=Counts(), on_bound=(),
    )  # fmt: skip

"""Normal equations of a solution, split into what data, priors and nuisances say of the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.solve.loss import Loss, Squares
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.clusters import Scores, projection, scores
from r2s2r_cli.stages.identify.trust.information import held, inverse, precision
from r2s2r_cli.stages.identify.trust.robust import bread_share, score_share


@dataclass(frozen=True)
class Parts:
    """weighted: sqrt(w) J (m, n); pull: sqrt(w) r (m,); prior: precisions (n,); hessian: (n, n), of the robust cost and
    priors. Of the parameters alone (p, p), nuisances marginalised: information, covariance of the data's scores if
    residuals had variance 1; curvature, of the cost with own priors; bread, its inverse. normal: variance of scores
    under normal noise of variance 1, as a share of `information`. used: degrees of freedom that the fit took.
    """

    weighted: np.ndarray
    pull: np.ndarray
    prior: np.ndarray
    hessian: np.ndarray
    information: np.ndarray
    curvature: np.ndarray
    bread: np.ndarray
    normal: float
    used: float

    @property
    def own_prior(self) -> np.ndarray:
        """Precision of the parameters' priors, (p, p)."""
        return np.diag(self.prior[: len(self.bread)])


def parts_of(problem: Problem, solution: Solution, loss: Loss, block: np.ndarray | None) -> Parts:
    """At a solution. block: as in Evaluation; None: no robust loss."""
    share = normal = 1.0
    if block is not None and not isinstance(loss, Squares):
        share, normal = bread_share(loss, solution.residual, block), score_share(loss, block)
    p = len(problem.names)
    root = np.sqrt(solution.weight)
    weighted = solution.jacobian * root[:, None] * ~held(problem)
    prior = precision(problem)
    data = weighted.T @ weighted
    hessian = share * data + np.diag(prior)
    project = projection(hessian, p)
    nuisance = np.diag(np.where(np.arange(len(prior)) < p, 0.0, prior))
    curvature = project @ hessian @ project.T
    return Parts(
        weighted, solution.residual * root, prior, hessian, project @ (data + nuisance) @ project.T,
        curvature, inverse(curvature), normal, float(np.sum(inverse(data + np.diag(prior)) * data)),
    )  # fmt: skip


def scores_of(problem: Problem, solution: Solution, parts: Parts, cluster: np.ndarray) -> Scores:
    """Scores of clusters (m,) int; priors of nuisances are observations of their windows."""
    p = len(problem.names)
    nuisance = np.arange(len(parts.prior)) >= p
    pulled = parts.prior * np.where(parts.prior > 0, solution.z - problem.prior_mean, 0.0)
    return scores(parts.weighted, parts.pull, parts.hessian, (nuisance * parts.prior, nuisance * pulled), cluster, p)

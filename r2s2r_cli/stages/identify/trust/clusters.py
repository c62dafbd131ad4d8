"""How much stronger residuals pull on the parameters, window by window, than independent noise would.

Residuals of one window share its misfit and its tracker's drift. The scores of windows, u_s = T J_s^T W r_s, show it:
T takes out what the nuisances explain. Under independent noise their expected outer product is known exactly, leverage
included, so the ratio of the two is an estimate of the inflation that needs no large number of windows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.trust.information import inverse


@dataclass(frozen=True)
class Scores:
    """score: (cluster, p), at the solution. expected: (cluster, p, p), covariance of each if residuals were independent
    with variance 1. project: (p, n), T, which takes out the nuisances."""

    score: np.ndarray
    expected: np.ndarray
    project: np.ndarray

    @property
    def count(self) -> int:
        """Clusters."""
        return len(self.score)


@dataclass(frozen=True)
class Inflation:
    """Ratio of found to expected variance of the scores, averaged over parameters; dof: of its estimate."""

    value: float
    dof: float


def projection(hessian: np.ndarray, p: int) -> np.ndarray:
    """T (p, n): a score of all unknowns becomes the part that moves the first p."""
    found: np.ndarray = np.hstack([np.eye(p), -hessian[:p, p:] @ inverse(hessian[p:, p:])])
    return found


def owners(jacobian: np.ndarray, cluster: np.ndarray, p: int) -> np.ndarray:
    """(n,) int: which of the sorted clusters an unknown belongs to, the one that depends on it most; parameters: -1."""
    energy = np.array([np.sum(jacobian[cluster == one, p:] ** 2, axis=0) for one in np.unique(cluster)])
    return np.concatenate([np.full(p, -1), np.argmax(energy, axis=0)])


def scores(
    weighted: np.ndarray, pull: np.ndarray, hessian: np.ndarray, prior: tuple[np.ndarray, np.ndarray],
    cluster: np.ndarray, p: int,
) -> Scores:  # fmt: skip
    """Of clusters (m,) int. weighted: (m, n), sqrt(w) J; pull: (m,), sqrt(w) r; hessian: (n, n), priors included.

    prior: precision (n,) and score precision * (z - mean) (n,) of the nuisances' priors, 0 for parameters. A nuisance
    counts as an observation of its owner: the start of a window belongs to the window.
    """
    precision, prior_score = prior
    project = projection(hessian, p)
    inside = inverse(hessian)
    found = np.unique(cluster)
    owner = owners(weighted, cluster, p)
    score, expected = np.empty((len(found), p)), np.empty((len(found), p, p))
    for k, one in enumerate(found):
        rows, mine = weighted[cluster == one], owner == k
        own = np.where(mine, precision, 0.0)[:, None] * project.T
        score[k] = project @ (rows.T @ pull[cluster == one] + np.where(mine, prior_score, 0.0))
        seen = rows.T @ (rows @ project.T) + own
        expected[k] = project @ seen - seen.T @ inside @ seen
    return Scores(score, 0.5 * (expected + expected.transpose(0, 2, 1)), project)


def pooled(found: Scores, posterior: np.ndarray) -> Inflation | None:
    """One inflation for all parameters, each counted by its posterior covariance (p, p). None where residuals cannot
    show it: a single window explains itself.

    Degrees of freedom: Satterthwaite (1946), of a sum of quadratic forms of normal scores.
    """
    expected = found.expected @ posterior
    mean = float(np.trace(expected, axis1=1, axis2=2).sum())
    spread = float(np.einsum("sij,sji->", expected, expected))
    total = float(np.trace(np.einsum("sij->ij", expected)))
    if found.count < 2 or mean <= 1e-6 * found.count or spread <= 0.0:
        return None
    value = float(np.einsum("si,ij,sj->", found.score, posterior, found.score)) / mean
    return Inflation(value, total**2 / spread)


def sandwich(found: Scores, posterior: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (p, p) of the scores of all clusters together, and degrees of freedom (p,) of the variances it gives.

    information: (p, p), that covariance under independent noise. Sums of outer products fall short of it by the
    leverage of the clusters; they are raised in proportion, so that they are right on average under such noise (the
    idea of CR2, Bell and McCaffrey 2002, with one factor for all parameters).
    """
    outer = found.score.T @ found.score
    kept = float(np.einsum("sij,ji->", found.expected, posterior))
    raised = outer * float(np.trace(information @ posterior)) / kept
    each = np.einsum("ai,sij,aj->as", posterior, found.expected, posterior)
    dof = each.sum(axis=1) ** 2 / np.maximum((each**2).sum(axis=1), 1e-300)
    return raised, dof

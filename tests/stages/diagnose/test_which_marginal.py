"""What all data together say for an effect: the marginal likelihood, where it is known in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from r2s2r_cli.stages.diagnose.which import marginal
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES

ROWS, SCALE = 40, 0.7


def fitted(y: np.ndarray, X: np.ndarray, sd: np.ndarray, scale: np.ndarray) -> Any:
    """The best fit of y = X w + noise of sd 1 under a prior of these sd, as the solver would hand it on."""
    H = X.T @ X + np.diag(sd**-2.0)
    w = np.linalg.solve(H, X.T @ y)
    cost = 0.5 * float(np.sum((y - X @ w) ** 2) + np.sum((w / sd) ** 2))
    return SimpleNamespace(cost=cost, hypothesis=SimpleNamespace(stack=lambda _: scale), H=H)


@pytest.mark.parametrize("planted", [0.0, 0.3, 3.0])
def test_laplace_is_exact_where_everything_is_linear(planted: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two nuisances and an effect of one number: the ratio of the densities of the data with the effect and without."""
    rng = np.random.default_rng(1)
    X = rng.standard_normal((ROWS, 3))
    y = X @ np.array([0.4, -0.2, planted]) + rng.standard_normal(ROWS)
    sd = np.array([0.5, 0.5, PRIOR_SCALES * SCALE])
    monkeypatch.setattr(marginal, "Fits", lambda _: SimpleNamespace(normal=lambda fit: (fit.H, None)))
    without, with_it = fitted(y, X[:, :2], sd[:2], np.zeros(0)), fitted(y, X, sd, np.array([SCALE]))
    found = marginal.marginal_gains(None, without, [with_it, without])  # type: ignore[arg-type]
    plain, more = (
        multivariate_normal(cov=np.eye(ROWS) + (X[:, :n] * sd[:n] ** 2) @ X[:, :n].T).logpdf(y) for n in (2, 3)
    )
    assert found == pytest.approx([more - plain, 0.0], abs=1e-9)
    assert (found[0] > 0) == (planted > 0.3)

"""What all data together say for an effect: the marginal likelihood, where it is known in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from r2s2r_cli.stages.diagnose.which import marginal
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES

ROWS, SCALE = 40, 0.7


def fitted(y: np.ndarray, X: np.ndarray, sd: np.ndarray, scale: np.ndarray) -> Any:
    """The best fit of y = X w + noise of sd 1 under a prior of these sd, as the solver would hand it on."""
    H = X.T @ X + np.diag(sd**-2.0)
    w = np.linalg.solve(H, X.T @ y)
    cost = 0.5 * float(np.sum((y - X @ w) ** 2) + np.sum((w / sd) ** 2))
    return SimpleNamespace(
        cost=cost, hypothesis=SimpleNamespace(stack=lambda _: scale), H=H, residual=y - X @ w
    )  # fmt: skip


def solver(monkeypatch: pytest.MonkeyPatch, pieces: int) -> None:
    """Residuals are so many pieces, each as likely as squares say."""
    monkeypatch.setattr(marginal, "Fits", lambda _: SimpleNamespace(
        normal=lambda fit: (fit.H, None),
        nats=lambda r: 0.5 * np.sum(r.reshape(len(r), pieces, -1) ** 2, axis=-1),
    ))  # fmt: skip


@pytest.mark.parametrize("planted", [0.0, 0.3, 3.0])
def test_laplace_is_exact_where_everything_is_linear(planted: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two nuisances and an effect of one number: the ratio of the densities of the data with the effect and without."""
    rng = np.random.default_rng(1)
    X = rng.standard_normal((ROWS, 3))
    y = X @ np.array([0.4, -0.2, planted]) + rng.standard_normal(ROWS)
    sd = np.array([0.5, 0.5, PRIOR_SCALES * SCALE])
    solver(monkeypatch, pieces=8)
    without, with_it = fitted(y, X[:, :2], sd[:2], np.zeros(0)), fitted(y, X, sd, np.array([SCALE]))
    gains = marginal.marginal_gains(None, without, [with_it, without])  # type: ignore[arg-type]
    found = gains.whole
    plain, more = (
        multivariate_normal(cov=np.eye(ROWS) + (X[:, :n] * sd[:n] ** 2) @ X[:, :n].T).logpdf(y) for n in (2, 3)
    )
    assert found == pytest.approx([more - plain, 0.0], abs=1e-9)
    assert (found[0] > 0) == (planted > 0.3)
    # Of 8 pieces with five numbers each none says too much of what is small, and all of them of what is large.
    if planted < 3:
        assert gains.counted == pytest.approx(found, abs=0.6)
    else:
        assert ENOUGH < gains.counted[0] < 8 * ENOUGH < found[0]


@pytest.mark.parametrize("pieces", [4, 20])
def test_one_piece_says_no_more_than_enough(pieces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that explains one piece by far better than anything else counts ENOUGH for it, one that explains many a
    little counts in full; what the data pay for its number is paid by both."""
    solver(monkeypatch, pieces)
    H, scale = np.eye(1), np.array([1.0])
    each = ROWS // pieces
    base = SimpleNamespace(cost=0.0, hypothesis=SimpleNamespace(stack=lambda _: np.zeros(0)), H=np.eye(0),
                           residual=np.full(ROWS, 2.0))  # fmt: skip
    fallen, spread = base.residual.copy(), np.full(ROWS, np.sqrt(4.0 - 2.0 / each))
    base.residual[:each] = fallen[:each] = 9.0
    spread[:each] = 9.0
    fallen[:each] = 0.0
    fits = [SimpleNamespace(cost=0.0, hypothesis=SimpleNamespace(stack=lambda _: scale), H=H, residual=r)
            for r in (fallen, spread)]  # fmt: skip
    found = marginal.marginal_gains(None, base, fits)  # type: ignore[arg-type, list-item]
    # Costs of the fits are the same here, so that all that counts is what bounding took off, and the price of a number.
    price = -np.log(PRIOR_SCALES)
    assert found.whole == pytest.approx([price, price])
    taken = found.counted - found.whole
    first, many = 0.5 * each * 81.0, float(pieces - 1)
    assert taken[0] == pytest.approx(ENOUGH - first, abs=1.0)
    assert taken[1] == pytest.approx(0.0, abs=0.05 * many)


def test_a_pair_counts_its_first_effect_and_all_that_the_second_adds() -> None:
    """Also where a single piece says it."""
    both = marginal.Gains(np.array([10.0, 4.0]), np.array([35.0, 4.0])).less(np.array([1.0, 0.0]))
    found = both.with_pairs(0, np.array([60.0]))
    assert found.whole == pytest.approx([34.0, 4.0, 60.0])
    assert found.counted == pytest.approx([9.0, 4.0, 9.0 + 26.0])


def test_a_fit_that_breaks_off_gains_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it cannot be simulated its cost is infinite: it counts as no number would, and spoils no other fit."""
    solver(monkeypatch, pieces=4)
    base, good = (SimpleNamespace(cost=cost, hypothesis=SimpleNamespace(stack=lambda _: np.zeros(0)), H=np.eye(0),
                                  residual=np.full(ROWS, r)) for cost, r in ((80.0, 2.0), (20.0, 1.0)))  # fmt: skip
    broken = SimpleNamespace(**{**vars(good), "cost": np.inf, "residual": np.r_[np.full(ROWS - 1, 1.0), np.inf]})
    found = marginal.marginal_gains(None, base, [broken, good])  # type: ignore[arg-type, list-item]
    assert found.counted[0] == -np.inf and 0 < found.counted[1] < 4 * ENOUGH + 0.1

"""Small problems whose minimum is known, in the form that the solvers take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.problem import Evaluation

INF = np.inf


@dataclass
class Formula:
    """A problem of two functions: residuals (m,) and Jacobian (m, n) of z. calls: whether each one had the Jacobian."""

    f: Callable[[np.ndarray], np.ndarray]
    df: Callable[[np.ndarray], np.ndarray]
    names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    prior_mean: np.ndarray
    prior_sd: np.ndarray
    block_size: int = 1
    calls: list[bool] = field(default_factory=list)

    @property
    def block(self) -> np.ndarray:
        """Which robust weight each residual shares."""
        return np.arange(len(self.f(self.prior_mean))) // self.block_size

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Of many points (k, n), nan where `f` gives nan."""
        assert np.all(z >= self.lower)
        assert np.all(z <= self.upper)
        return np.stack([self.f(one) for one in z])

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Raises NumericalError where `f` gives nan, as the simulation does."""
        assert np.all(z >= self.lower)
        assert np.all(z <= self.upper)
        self.calls.append(jacobian)
        residual = self.f(z)
        if np.isnan(residual).any():
            raise NumericalError("the simulation is not finite", hint="r2s2r identify --help")
        return Evaluation(residual, self.df(z) if jacobian else None, np.arange(len(residual)) // self.block_size)


def formula(f, df, n: int, *, lower=-INF, upper=INF, prior_mean=0.0, prior_sd=INF, names=None, block_size=1) -> Formula:
    """A problem in n unknowns, all of them parameters unless `names` names fewer."""
    fill = [np.broadcast_to(np.asarray(one, dtype=float), (n,)) for one in (lower, upper, prior_mean, prior_sd)]
    return Formula(f, df, tuple(names or "abcdefgh"[:n]), *fill, block_size=block_size)


def linear(seed: int = 0, m: int = 30, n: int = 4, **options) -> tuple[Formula, np.ndarray, np.ndarray]:
    """|A z - b|^2 with A (m, n) and b (m,) drawn."""
    draw = np.random.default_rng(seed)
    a, b = draw.normal(size=(m, n)), draw.normal(size=m)
    return formula(lambda z: a @ z - b, lambda z: a, n, **options), a, b


def rosenbrock(**options) -> Formula:
    """Rosenbrock's valley; minimum 0 at (1, 1)."""
    return formula(
        lambda z: np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]]),
        lambda z: np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0]]),
        2,
        **options,
    )


DECAY_TRUTH = np.array([2.0, 0.7, 0.5])
DECAY_START = np.array([1.0, 2.0, 0.0])


def decay(seed: int = 0, *, sd: float = 0.05, until: float = 6.0, **options) -> Formula:
    """a exp(-b t) + c at 40 times up to `until`, with normal noise; truth DECAY_TRUTH."""
    t = np.linspace(0.0, 6.0, 40)
    y = DECAY_TRUTH[0] * np.exp(-DECAY_TRUTH[1] * t) + DECAY_TRUTH[2] + np.random.default_rng(seed).normal(0, sd, 40)
    t, y = t[t <= until], y[t <= until]
    return formula(
        lambda z: (z[0] * np.exp(-z[1] * t) + z[2] - y) / sd,
        lambda z: np.stack([np.exp(-z[1] * t), -z[0] * t * np.exp(-z[1] * t), np.ones_like(t)], axis=1) / sd,
        3,
        **options,
    )


def line_with_outliers(seed: int) -> Formula:
    """y = 1 + 2 t in three axes with noise 1, 20 % of the 40 blocks 30 off in one direction; truth (1, 2)."""
    draw = np.random.default_rng(seed)
    t = np.repeat(np.linspace(0.0, 10.0, 40), 3)
    y = 1.0 + 2.0 * t + draw.normal(size=120)
    y[np.repeat(draw.permutation(40) < 8, 3)] += 30.0
    a = np.stack([np.ones_like(t), t], axis=1)
    return formula(lambda z: a @ z - y, lambda z: a, 2, block_size=3)

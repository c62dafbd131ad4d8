"""An arena without a simulator: residuals are linear in all numbers, so that everything can be worked out by hand."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np

from r2s2r_cli.stages.diagnose.which.candidates import Candidate
from r2s2r_cli.stages.diagnose.which.mixture import FACTORS, minus_log
from r2s2r_cli.stages.diagnose.which.white import Kind, White, whitened

STRETCHES, EACH = 6, 60


class LinearArena:
    """residual = A z + B x - y, white; stretches of EACH numbers, two a gait. The model's values are [z | x]. Of the
    kinds of errors each is FACTORS times as large as the first. begins: responses C (EACH,) to offsets a of the
    starts, bends: D (EACH,), which add C a + D a^2; `began`: where they really are."""

    def __init__(
        self, truth: float, *, noise: float = 1.0, seed: int = 0, begins: Sequence[np.ndarray] = (),
        bends: Sequence[np.ndarray] = (),
    ) -> None:  # fmt: skip
        rng = np.random.default_rng(seed)
        M = STRETCHES * EACH
        self.A, self.B = rng.standard_normal((M, 2)), rng.standard_normal((M, 2))
        self.y = self.A @ [0.3, -0.2] + self.B[:, 0] * truth + noise * rng.standard_normal(M)
        self.mean, self.precision = np.zeros(2), np.eye(2)
        self.lower, self.upper = np.full(2, -10.0), np.full(2, 10.0)
        self.by_nuisance = kinds_of(self.A.T).T
        self.engine, self.shared = [0, 1], 2
        self.many = tuple(SimpleNamespace(run="a", interval=k + 1, caps=np.zeros((1, 1, 3))) for k in range(STRETCHES))
        self.whole = self.many
        self.gait = np.arange(STRETCHES) // 2
        self.away = np.zeros((STRETCHES, len(begins)))
        self.C = np.array(begins).reshape(len(begins), 1, EACH)
        self.D = np.array(bends).reshape(len(begins), 1, EACH)
        self.began = np.zeros((STRETCHES, len(begins)))
        self.white = [
            White(tuple(_kind(factor, slice(c * M + k * EACH, c * M + (k + 1) * EACH), self.C)
                        for c, factor in enumerate(FACTORS)), EACH)
            for k in range(STRETCHES)
        ]  # fmt: skip
        self.logdets = np.array([white.logdet for white in self.white])
        self.sizes = np.full(STRETCHES, float(EACH))

    def values(self, z: np.ndarray) -> np.ndarray:
        """Off."""
        return np.concatenate([z, np.zeros((len(z), 2))], axis=1)

    def raw(
        self, values: np.ndarray, z: np.ndarray, only: object = None, away: np.ndarray | None = None
    ) -> list[np.ndarray]:  # fmt: skip
        """By stretch, (k, EACH + offset): of the first starts, along straight lines; none is linked to another one."""
        whole = values[:, :2] @ self.A.T + values[:, 2:] @ self.B.T - self.y
        there = np.repeat(self.away[None], len(values), axis=0) if away is None else away
        bent = there**2 - self.began**2
        parts = whole.reshape(len(values), STRETCHES, 1, EACH).transpose(1, 0, 2, 3)
        seen = [
            one - np.einsum("o,ocf->cf", self.began[k], self.C) + np.einsum("ko,ocf->kcf", bent[:, k], self.D)
            for k, one in enumerate(parts)
        ]
        return [np.concatenate([one.reshape(len(values), EACH), 0.0 * there[:, 0]], axis=1) for one in seen]

    def residuals(
        self, values: np.ndarray, z: np.ndarray, only: object = None, away: np.ndarray | None = None
    ) -> np.ndarray:  # fmt: skip
        """White under each kind, (k, kind M)."""
        return whitened(self.white, self.raw(values, z, only, away))

    def settled(self, values: np.ndarray, z: np.ndarray, only: object, away: np.ndarray) -> np.ndarray:
        """As `Arena`: of each stretch the better of two starts."""
        wanted = self.likely_starts(self.raw(values, z, None, away))
        both = [self.residuals(values, z, None, at) for at in (away, wanted)]
        costs = [minus_log(self.squares(one), self.logdets, self.sizes) for one in both]
        rows = np.array([np.tile(np.repeat(one, EACH), len(FACTORS)) for one in costs[1] < costs[0]])
        return np.where(rows, both[1], both[0])

    def likely_starts(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        """As `Arena`, of the first kind."""
        return np.stack([white.kinds[0].start(white.kinds[0].rooted(white.residual(one)))
                         for white, one in zip(self.white, raw, strict=True)], axis=1)  # fmt: skip

    def keys(self, values: np.ndarray, z: np.ndarray, only: Sequence[int]) -> np.ndarray:
        """Key frames of one cap; as the engine, none of nothing."""
        assert len(only)
        return np.zeros((len(z), len(only), 1, 3))

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """By stretch and kind."""
        found = (residual.reshape(len(residual), len(FACTORS), STRETCHES, EACH) ** 2).sum(axis=-1)
        return np.asarray(found.transpose(0, 2, 1))


def kinds_of(residual: np.ndarray) -> np.ndarray:
    """Rows (n, M) under every kind of error, (n, kind M)."""
    return np.concatenate([residual / factor for factor in FACTORS], axis=1)


def _kind(factor: float, rows: slice, C: np.ndarray) -> Kind:
    """Of noise `factor`, with one sd of the starts' offsets along C (offset, 1, EACH); the columns are orthogonal."""
    V = C.reshape(len(C), EACH) / factor
    square = np.maximum(np.sum(V**2, axis=1), 1e-12)
    return Kind(
        roots=np.eye(EACH)[None] / factor, U=V.T / np.sqrt(square), shrink=1.0 - 1.0 / np.sqrt(1.0 + square), rows=rows,
        logdet=2 * EACH * float(np.log(factor)) + float(np.log1p(square).sum()),
        to_start=V / (1.0 + square)[:, None], known=np.diag(1.0 / np.sqrt(1.0 + square)),
    )  # fmt: skip


def candidate(name: str, place: int) -> Candidate:
    """Number `place` of B, off at 0; -2 and -1: the nuisances themselves, which it then sets."""
    one = np.ones(1)
    return Candidate(name, "motor", None, ((2 + place,),), (f"{name}.x",), ("1",), 0 * one, -5 * one, 5 * one, one,
                     np.array([[0.5], [-0.5], [1.5], [-1.5]]), np.zeros(1, dtype=bool), 0 * one)  # fmt: skip

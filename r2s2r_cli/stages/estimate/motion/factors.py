"""What is known about single frames, as weighted squares of residuals that are linear near the present states."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Frames:
    """Sum of costs over frames: value, gradient (frame, dim), Gauss-Newton matrix (frame, dim, dim).

    A cost is half a squared residual over its variance; with `freedom` that of Student's t instead, which a residual
    far out moves little (Lange, Little and Taylor, JASA 84 (1989) 881).
    """

    frames: int
    dim: int
    cost: float = 0.0
    gradient: np.ndarray = field(init=False)
    matrix: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.gradient = np.zeros((self.frames, self.dim))
        self.matrix = np.zeros((self.frames, self.dim, self.dim))

    def scalar(
        self, states: np.ndarray, slope: np.ndarray, residual: np.ndarray, weight: np.ndarray,
        freedom: float | None = None, bend: float | None = None,
    ) -> None:  # fmt: skip
        """Add one residual a frame. bend: beyond so many standard deviations its cost grows linearly (pseudo-Huber).

        states: indices that it depends on, shape (m,); slope: its derivatives by these, (frame, m); residual, weight
        (1 / variance; 0: none): (frame,).
        """
        square = weight * residual**2
        value, used = _robust(square, 1, freedom) if bend is None else _bent(square, bend)
        self.cost += value
        weighted = slope * (used * weight)[:, None]
        self.gradient[:, states] += weighted * residual[:, None]
        self.matrix[:, states[:, None], states] += weighted[:, :, None] * slope[:, None, :]

    def vector(
        self,
        states: np.ndarray,
        slope: np.ndarray,
        residual: np.ndarray,
        information: np.ndarray,
        freedom: float | None = None,
        bend: float | None = None,
    ) -> None:
        """Add r' I r / 2: states (m,), slope (frame, 3, m), residual r (frame, 3), information I (frame, 3, 3)."""
        pull = np.einsum("kij,kj->ki", information, residual)
        square = np.sum(pull * residual, axis=1)
        value, used = _robust(square, 3, freedom) if bend is None else _bent(square, bend)
        self.cost += value
        turned = np.swapaxes(slope, 1, 2)
        self.gradient[:, states] += used[:, None] * (turned @ pull[:, :, None])[:, :, 0]
        self.matrix[:, states[:, None], states] += used[:, None, None] * (turned @ information @ slope)


def heavy_tail(square: np.ndarray, count: int, freedom: float) -> np.ndarray:
    """Weight that Student's t with `freedom` gives a residual of `count` parts with this squared size; 1 on average."""
    return np.asarray((freedom + count) / (freedom + square))


def _bent(square: np.ndarray, bend: float) -> tuple[float, np.ndarray]:
    root = np.sqrt(1.0 + square / bend**2)
    return bend**2 * float(np.sum(root - 1.0)), 1.0 / root


def _robust(square: np.ndarray, count: int, freedom: float | None) -> tuple[float, np.ndarray]:
    if freedom is None:
        return 0.5 * float(np.sum(square)), np.ones(len(square))
    return (
        0.5 * (freedom + count) * float(np.sum(np.log1p(square / freedom))),
        heavy_tail(square, count, freedom),
    )

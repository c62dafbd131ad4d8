"""The default fit as a least-squares problem: observed minus simulated end caps of training windows, over the noise."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from r2s2r_cli.stages.identify.candidates import predict_candidates
from r2s2r_cli.stages.identify.free.base import Free, slopes_of, values_of
from r2s2r_cli.stages.identify.offsets import StartSpread, count
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.prediction import Prediction
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.windows import Window

LEAST_NOISE = 1e-5
"""[m] A simulated log without noise must not divide by 0."""
CHI2_MEDIAN = 0.4549
"""Median of a squared standard normal number."""
FIXED_SD = 1e-9
"""Prior sd of an offset that is not free: it stays, and needs no case of its own."""


class CapResiduals:
    """A `Problem`: unknowns are the coordinates of the free parameters, then the offsets of every window's start.

    noise: sd of an observed coordinate is at least this [m]; a model that is not exact misses by more than the tracker.
    key_only: compare key frames only (the paper's Key Frame Loss without its detours), else every frame. Windows whose
    start is known have no offsets. cluster: target interval of each residual, in which misfit and tracker errors
    persist; windows that overlap share it. held: parameters that stay at their starts. A fit begins at z0, which of an
    effect is not the mean of its prior.
    """

    def __init__(
        self,
        predictor: Predictor,
        windows: Sequence[Window],
        *,
        spread: StartSpread | None = None,
        noise: float = 1e-3,
        key_only: bool = False,
        held: Sequence[str] = (),
    ) -> None:
        self.predictor = predictor
        self.windows = tuple(windows)
        self.frees = predictor.mapping.frees
        self.names = predictor.mapping.names
        n = len(self.frees)
        self.offsets = 0 if all(window.known for window in windows) else count(predictor.structure)
        sd = (spread or StartSpread()).sd(predictor.structure)
        sd = np.where(sd > 0, sd, FIXED_SD)
        each = [np.full_like(sd, FIXED_SD) if window.known else sd for window in windows] if self.offsets else []
        bounds = np.array([free.bounds_z() for free in self.frees]).reshape(-1, 2)
        rest = self.offsets * len(windows)
        self.lower = np.concatenate([bounds[:, 0], np.full(rest, -np.inf)])
        self.upper = np.concatenate([bounds[:, 1], np.full(rest, np.inf)])
        start = np.array([free.to_z(free.start) for free in self.frees])
        mean = np.array([free.to_z(free.mean) for free in self.frees])
        self.prior_mean = np.concatenate([mean, np.zeros(rest)])
        self.held = tuple(held)
        own_sd = [FIXED_SD if free.name in held else free.prior_sd for free in self.frees]
        self.prior_sd = np.concatenate([np.array(own_sd), *each])
        self.z0 = np.concatenate([start, np.zeros(rest)])
        self.kept = np.concatenate([w.key if key_only else np.ones(len(w.frames), bool) for w in windows])
        self._observed = np.concatenate([w.run.observed[w.frames] for w in windows])[self.kept]
        self._noise = np.concatenate([w.run.sd_at(w.frames, LEAST_NOISE) for w in windows])[self.kept]
        least = max(noise, LEAST_NOISE)
        self._sd = np.concatenate([w.run.sd_at(w.frames, least) for w in windows])[self.kept]
        self._window = np.concatenate([np.full(len(w.frames), k) for k, w in enumerate(windows)])[self.kept]
        runs = list(dict.fromkeys(w.run.name for w in windows))
        most = 1 + max(max(w.intervals) for w in windows)
        place = [runs.index(w.run.name) * most + np.array(w.intervals)[w.place] for w in windows]
        self.cluster = np.repeat(np.concatenate(place)[self.kept], self._observed[0].size)
        self.block = np.repeat(np.arange(self._observed[..., 0].size), 3)
        self._width = n

    def starting(self, frees: Sequence[Free]) -> CapResiduals:
        """The same problem with other starts and priors of its parameters; what is held is held at its new start."""
        other, n = copy(self), self._width
        other.frees = tuple(frees)
        start = [free.to_z(free.start) for free in frees]
        own_sd = [FIXED_SD if free.name in self.held else free.prior_sd for free in frees]
        other.prior_mean = np.concatenate([[free.to_z(free.mean) for free in frees], self.prior_mean[n:]])
        other.prior_sd = np.concatenate([own_sd, self.prior_sd[n:]])
        other.z0 = np.concatenate([start, self.prior_mean[n:]])
        return other

    @property
    def exact(self) -> bool:
        """Whether residuals are weighed with the measured noise alone."""
        return bool(np.array_equal(self._sd, self._noise))

    def misfit(self, z: np.ndarray) -> float:
        """Median size of the residuals over the measured noise: 1 where the model is exact and the noise normal."""
        square = ((self.predict(z).p_WE[self.kept] - self._observed) / self._noise) ** 2
        return float(np.sqrt(np.median(square) / CHI2_MEDIAN))

    def split(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Values (n,) in their units and offsets (W, offset), None where no start is free."""
        n = self._width
        offsets = z[n:].reshape(len(self.windows), self.offsets) if self.offsets else None
        return values_of(self.frees, z[:n]), offsets

    def predict(self, z: np.ndarray, *, jacobian: bool = False) -> Prediction:
        """End caps at all frames of the windows."""
        values, offsets = self.split(z)
        return self.predictor.predict(self.windows, values, offsets, jacobian=jacobian)

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Residuals (k, m) at points (k, unknowns), as `evaluate` has them; nan where nothing finite comes out."""
        n = self._width
        values = np.stack([values_of(self.frees, one[:n]) for one in z])
        offsets = z[:, n:].reshape(len(z), len(self.windows), self.offsets) if self.offsets else None
        caps = predict_candidates(self.predictor, self.windows, values, offsets)[:, self.kept]
        return np.asarray(((caps - self._observed) / self._sd).reshape(len(z), -1))

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Residuals (simulated - observed) / sd at z. Raises NumericalError where nothing finite comes out."""
        seen = self.predict(z, jacobian=jacobian)
        residual = ((seen.p_WE[self.kept] - self._observed) / self._sd).reshape(-1)
        if not jacobian or seen.by_value is None:
            return Evaluation(residual, None, self.block)
        n = self._width
        d = np.zeros((*self._observed.shape, len(z)))
        d[..., :n] = seen.by_value[self.kept] * slopes_of(self.frees, z[:n])
        if seen.by_offset is not None:
            by = seen.by_offset[self.kept]
            for k in range(len(self.windows)):
                rows = self._window == k
                d[rows, ..., n + k * self.offsets : n + (k + 1) * self.offsets] = by[rows]
        d /= self._sd[..., None]
        return Evaluation(residual, d.reshape(len(residual), len(z)), self.block)

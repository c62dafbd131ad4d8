"""Key frames and durations with the controller in the loop, as a least-squares problem without exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.closed_flight import Flight
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.offsets import StartSpread, displaced
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.residuals import CHI2_MEDIAN, FIXED_SD, LEAST_NOISE, CapResiduals
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.secant import secant_jacobian
from r2s2r_cli.stages.identify.trust.information import widths
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

WIDTHS = (0.05, 0.2)
"""Of the differences, in widths of the priors: some percent. A control tick is some percent of a short interval."""


class ClosedResiduals(CapResiduals):
    """A `Problem`: unknowns are the coordinates of the free parameters, the offsets of every window's start, and how
    much later than the log says each target was given [s], those that begin and end the intervals of each window.

    Residuals: (simulated - observed) / sd of the caps at key frames, window by window, interval by interval, up to a
    tip-over; then (simulated - real) duration of each interval over its sd. Parameters act by simulation, the others
    linearly: offsets by differences of one prior sd either way at `values`, switches by the velocity of the caps. Where
    a start is only known so well, its error moves every key frame after it, and where a switch lies between two rows
    of the log, all caps of a key frame are early or late together: a fit that does not count these is too sure.

    noise: as in CapResiduals; durations differ by as much as a winch needs for it.
    """

    def __init__(
        self, predictor: Predictor, windows: Sequence[Window], values: np.ndarray, *,
        spread: StartSpread | None = None, noise: float = 1e-3, held: Sequence[str] = (),
    ) -> None:  # fmt: skip
        import torch

        super().__init__(predictor, windows, spread=spread, noise=noise, held=held)
        self.flights = tuple(Flight(one) for one in windows)
        self.at, self.noise = np.asarray(values, dtype=float), noise
        period = predictor.mapping.robot.pid.rate_hz**-1
        theta = predictor.mapping.theta(torch.as_tensor(self.at))
        slack = noise / float(theta.speed_in.mean())
        both = [(f.window.run, f.window.run.intervals.last[np.array(f.numbers) - 1]) for f in self.flights]
        self._key_sd = np.concatenate([run.sd_at(keys, max(noise, LEAST_NOISE)) for run, keys in both])
        self._key_noise = np.concatenate([run.sd_at(keys, LEAST_NOISE) for run, keys in both])
        # Ticks of the robot and of the simulation, neither of which falls on the other's.
        known = [np.hypot(f.log.between(f.numbers), period / np.sqrt(6.0)) for f in self.flights]
        ends = np.concatenate([np.where(np.isfinite(sd[1:]), 1.0, np.inf) for sd in known])
        self._took_sd = np.hypot(period / np.sqrt(6.0), slack) * ends
        self._switch_sd = [np.where(np.isfinite(sd), sd, 0.0) for sd in known]
        extra = np.concatenate(self._switch_sd)
        wide = np.full(len(extra), np.inf)
        self.lower, self.upper = np.concatenate([self.lower, -wide]), np.concatenate([self.upper, wide])
        self.prior_mean = np.concatenate([self.prior_mean, np.zeros(len(extra))])
        self.prior_sd = np.concatenate([self.prior_sd, np.where(extra > 0, extra, FIXED_SD)])
        self.z0 = np.concatenate([self.z0, np.zeros(len(extra))])
        runs = list(dict.fromkeys(w.run.name for w in windows))
        most = 1 + max(max(w.intervals) for w in windows)
        number = np.concatenate([runs.index(f.window.run.name) * most + np.array(f.numbers) for f in self.flights])
        window = np.concatenate([np.full(f.count, k) for k, f in enumerate(self.flights)])
        size = self._key_sd[0].size
        self.cluster = np.concatenate([np.repeat(number, size), number])
        self._of_window = np.concatenate([np.repeat(window, size), window])
        keys = np.repeat(np.arange(len(number) * size // 3), 3)
        self.block = np.concatenate([keys, keys[-1] + 1 + np.arange(len(number))])
        self.widths = widths(self, self.frees)
        self._by_others: np.ndarray | None = None

    @property
    def by_others(self) -> np.ndarray:
        """Derivatives of the residuals by all unknowns but the parameters, (m, n - p)."""
        if self._by_others is None:
            self._by_others = np.hstack([self._differences_by_offset(), self._derivatives_by_switch()])
        return self._by_others

    def split(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Values (n,) in their units and offsets (W, offset), None where no start is free."""
        return super().split(z[: len(self.frees) + self.offsets * len(self.windows)])

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Residuals at z, their Jacobian by central differences of one batch. Raises NumericalError."""
        p = len(self.frees)
        moved = self.by_others @ z[p:]
        if not jacobian:
            return Evaluation(self._compared(z[None, :p])[0] + moved, None, self.block)
        near, far = (width * self.widths for width in WIDTHS)
        found = secant_jacobian(self.batch, z[:p], (near, far), lower=self.lower[:p], upper=self.upper[:p])
        return Evaluation(found.residual + moved, np.hstack([found.jacobian, self.by_others]), self.block)

    def batch(self, points: np.ndarray) -> np.ndarray:
        """Residuals (k, m) of parameters (k, n), starts unmoved; nan where the simulation is not finite."""
        try:
            return self._compared(points)
        except NumericalError:
            if len(points) == 1:
                return np.full((1, len(self.block)), np.nan)
            return np.concatenate([self.batch(point[None]) for point in points])

    def with_best_others(self, z: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, Evaluation]:
        """All unknowns of parameters z (p,) whose residuals are `residual` where the others are 0: these of least
        squares, and the residuals with them."""
        p = len(self.frees)
        normal = self.by_others.T @ self.by_others + np.diag(self.prior_sd[p:] ** -2.0)
        others = -np.linalg.solve(normal, self.by_others.T @ residual)
        moved = Evaluation(residual + self.by_others @ others, None, self.block)
        return np.concatenate([z, others]), moved

    def misfit(self, z: np.ndarray) -> float:
        """Median size of the residuals of caps over the measured noise."""
        caps = self.evaluate(z, jacobian=False).residual[: self._key_sd.size].reshape(self._key_sd.shape)
        return float(np.sqrt(np.median((caps * self._key_sd / self._key_noise) ** 2) / CHI2_MEDIAN))

    def seconds(self, z: np.ndarray) -> tuple[float, float]:
        """How long all windows took, simulated and real [s], from their first target to their last end."""
        values = self._values(z[None, : len(self.frees)])
        took = sum(float(f.compared(self.predictor, values, self._start(k)).duration[0])
                   for k, f in enumerate(self.flights))  # fmt: skip
        return took, float(sum(f.took.sum() for f in self.flights))

    def _compared(self, points: np.ndarray) -> np.ndarray:
        """All windows, one after the other; the points of a window side by side."""
        values = self._values(points)
        parts = [f.compared(self.predictor, values, self._start(k)) for k, f in enumerate(self.flights)]
        keys = np.concatenate([part.caps for part in parts], axis=1) / self._key_sd
        return np.hstack([keys.reshape(len(points), -1), np.hstack([part.took for part in parts]) / self._took_sd])

    def _differences_by_offset(self) -> np.ndarray:
        """Central differences of one prior sd, all offsets of a window as one batch."""
        import torch

        if not self.offsets:
            return np.zeros((len(self.block), 0))
        p, n = len(self.frees), self.offsets
        found = np.zeros((len(self.block), n * len(self.windows)))
        for k, flight in enumerate(self.flights):
            sd = self.prior_sd[p + k * n : p + (k + 1) * n]
            free = np.flatnonzero(sd > 1e-8)
            by = np.zeros((2 * len(free), n))
            by[np.arange(len(free)), free] = sd[free]
            by[len(free) + np.arange(len(free)), free] = -sd[free]
            start = displaced(self.predictor.structure, self._start(k).expand(len(by), -1), torch.as_tensor(by))
            made = flight.compared(self.predictor, np.tile(self.at, (len(by), 1)), start)
            rows = self._of_window == k
            keys = made.caps / self._key_sd[self._window_rows(k)]
            flat = np.hstack([keys.reshape(len(by), -1), made.took / self._took_sd[self._window_rows(k)]])
            found[np.ix_(rows, k * n + free)] = ((flat[: len(free)] - flat[len(free) :]) / (2 * sd[free, None])).T
        return found

    def _derivatives_by_switch(self) -> np.ndarray:
        """A target given later is a key frame later, where caps are further on; one interval longer, one shorter."""
        found = np.zeros((len(self.block), sum(f.count + 1 for f in self.flights)))
        first, caps = 0, self._key_sd[0].size
        for k, flight in enumerate(self.flights):
            own = self._window_rows(k)
            made = flight.compared(self.predictor, self.at[None], self._start(k))
            moving = (made.moving[0] / self._key_sd[own]).reshape(flight.count, caps)
            for i in range(flight.count):
                row, sd = own.start + i, self._took_sd[own.start + i]
                found[row * caps : (row + 1) * caps, first + i] = -moving[i]
                found[self._key_sd.size + row, first + i : first + i + 2] = 1.0 / sd, -1.0 / sd
            first += flight.count + 1
        return found

    def _window_rows(self, k: int) -> slice:
        """Its intervals among those of all windows."""
        before = sum(f.count for f in self.flights[:k])
        return slice(before, before + self.flights[k].count)

    def _start(self, k: int) -> Tensor:
        """The start of a window as a flat state (1, NS)."""
        from r2s2r_cli.engine.flat import pack_state

        return pack_state(self.predictor.structure, self.windows[k].state)

    def _values(self, points: np.ndarray) -> np.ndarray:
        return np.array([values_of(self.frees, point) for point in points]).reshape(len(points), len(self.frees))

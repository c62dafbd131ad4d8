"""The causal filter's states of one moment, with covariance: carried on in time, and corrected by measurements."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.equations import START_SD, start_sd
from r2s2r_cli.stages.estimate.motion.measurements import Stack

AGAIN_SD = (0.15, 0.3)
"""Of position [m] and velocity [m/s] of every cap when it is looked for again."""
STOPS_S = 0.25
"""[s] A cap out of sight goes on with a velocity that fades with this time constant."""
ITERATIONS = 3
CAPPED_MPS = 3.0
"""No cap of such a robot is faster; keeps a wrong track from running away."""

Rows = Callable[[Stack, np.ndarray], None]
"""Puts the rows of measurements at given states (dim,) on a stack."""


class States:
    """Caps, their velocities and the sensors' offsets, in the layout of `Body`, without shared errors.

    x: (dim,). cov: (dim, dim). t: their time [s], NaN before the first `place`. elapsed: time gone by since whoever
    reads it set it to 0 [s], negative backwards. Corrections are iterated (Bell and Cathey, IEEE TAC 38 (1993) 294),
    because rods turn far while they are hidden. Raises nothing.
    """

    def __init__(self, body: Body, settings: MotionSettings) -> None:
        self.body, self.settings = body, settings
        self.x = np.zeros(body.dim)
        self.cov = np.diag(start_sd(body, settings) ** 2)
        self.t = float("nan")
        self.elapsed = 0.0

    @property
    def p_WE(self) -> np.ndarray:
        """Caps [m], (cap, 3)."""
        return self.body.positions(self.x).copy()

    @property
    def v_WE(self) -> np.ndarray:
        """Their velocities [m/s], (cap, 3)."""
        return self.body.velocities(self.x).copy()

    @property
    def cov_p(self) -> np.ndarray:
        """Their covariances [m^2], (cap, 3, 3)."""
        return np.stack([self.cov[np.ix_(s := self.body.p(c), s)] for c in range(self.body.caps)])

    @property
    def height_sd(self) -> np.ndarray:
        """Standard deviation of each cap's height [m], (cap,)."""
        return np.asarray(np.sqrt(self.cov.diagonal()[2 : 3 * self.body.caps : 3]))

    def place(self, t: float, p_WE: np.ndarray, cov: np.ndarray | None = None) -> None:
        """Put the caps, at rest at time t [s], at p_WE [m] (cap, 3). cov: (cap, 3, 3) [m^2], default that of AGAIN_SD.
        What is known of the sensors' offsets stays."""
        moving, half = self.body.moving, 3 * self.body.caps
        slow = self.cov[moving:, moving:].copy()
        self.cov = np.zeros_like(self.cov)
        self.cov[moving:, moving:] = slow
        self.cov[np.arange(moving), np.arange(moving)] = np.repeat(AGAIN_SD, half) ** 2
        if cov is not None:
            for cap in range(self.body.caps):
                states = self.body.p(cap)
                self.cov[np.ix_(states, states)] = cov[cap]
        self.x[:moving] = 0.0
        self.x[:half] = np.asarray(p_WE, dtype=float).ravel()
        self.t = float(t)

    def squares(self, p_WE: np.ndarray, cov: np.ndarray) -> np.ndarray:
        """Squared distance of each sighting (cap, 3) from the caps over its variance, (cap,); NaN: not sighted."""
        out = np.full(self.body.caps, np.nan)
        for cap in np.flatnonzero(np.all(np.isfinite(p_WE), axis=1)):
            states = self.body.p(int(cap))
            off = p_WE[cap] - self.x[states]
            out[cap] = off @ np.linalg.solve(self.cov[np.ix_(states, states)] + cov[cap], off)
        return out

    def go(self, t: float, in_sight: np.ndarray) -> float:
        """Go to time t [s]; in_sight: caps whose velocity lasts, bool (cap,). Time gone by [s], 0 before a start."""
        dt = float(t) - self.t
        if dt == 0.0 or not np.isfinite(dt):
            return 0.0
        body, size = self.body, abs(dt)
        half = 3 * body.caps
        rows = np.arange(half)
        f = np.eye(body.dim)
        f[rows, half + rows] = dt
        # Robots of cables stop soon: a velocity that was seen long ago says nothing.
        f[half + rows, half + rows] = np.repeat(np.where(in_sight, 1.0, np.exp(-size / STOPS_S)), 3)
        cov = self._accelerated(f @ self.cov @ f.T, dt, self.settings.acceleration)
        self.elapsed += dt
        bias = np.arange(body.bias.start, body.bias.stop)
        cov[bias, bias] += self.settings.sensor_walk_m**2 * size
        self.x = f @ self.x
        self.x[half : body.moving] = np.clip(self.x[half : body.moving], -CAPPED_MPS, CAPPED_MPS)
        place = np.minimum(cov[rows, rows], START_SD[0] ** 2) / cov[rows, rows]
        if np.any(place < 1.0):  # lost for minutes: wider than any room helps nobody
            shrink = np.ones(body.dim)
            shrink[rows] = np.sqrt(place)
            cov = cov * shrink[:, None] * shrink
        self.cov = cov
        self.t = float(t)
        return dt

    def shake(self, density: float) -> None:
        """Widen `cov` by white acceleration of that density [m^2/s^3] over `elapsed`."""
        self.cov = self._accelerated(self.cov, self.elapsed, density)

    def _accelerated(self, cov: np.ndarray, dt: float, density: float) -> np.ndarray:
        """Cov after white acceleration of that density over dt [s], either way in time."""
        rows, half, out = np.arange(3 * self.body.caps), 3 * self.body.caps, cov.copy()
        size = abs(dt)
        out[rows, rows] += density * size**3 / 3
        out[rows, half + rows] += density * dt * size / 2
        out[half + rows, rows] += density * dt * size / 2
        out[half + rows, half + rows] += density * size
        return out

    def correct(self, rows: Rows, *, iterations: int = ITERATIONS) -> None:
        """Take in measurements."""
        prior, x = self.x, self.x
        for _ in range(iterations):
            stack = Stack(self.body.dim)
            rows(stack, x)
            residual, slope, noise = stack.arrays()
            if not len(residual):
                return
            shared = self.cov @ slope.T
            inner = slope @ shared + noise
            gain = np.linalg.solve(inner, shared.T).T
            # residual: measured minus predicted at x; the prior stays that of the start.
            step = prior + gain @ (residual - slope @ (prior - x)) - x
            x = x + step
            if np.max(np.abs(step[: 3 * self.body.caps])) < 1e-4:
                break
        keep = np.eye(self.body.dim) - gain @ slope
        cov = keep @ self.cov @ keep.T + gain @ noise @ gain.T
        self.x, self.cov = x, 0.5 * (cov + cov.T)

"""Rows of the causal filter's measurements: residual, slope, variance at given states (one frame)."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings

BELOW_SD_M = 2e-3
ON_FLOOR_M = 0.003
"""[m] A cap lower than this is taken to stand; it then slips slowly."""
SURE_M = 0.01
"""[m] Heights less certain than this tell no contact."""
STANDING_SD_M = 0.02
"""[m] In one frame; of many frames together far less."""
SLIP_SD_M_PER_S = 0.15
"""Of a standing cap in one frame: 0.03 m/s that lasts 0.3 s or more, as independent values a frame."""


class Stack:
    """Rows that pile up."""

    def __init__(self, dim: int) -> None:
        self.dim = dim
        self._residual: list[np.ndarray] = []
        self._slope: list[np.ndarray] = []
        self._noise: list[np.ndarray] = []

    def add(self, states: np.ndarray, residual: np.ndarray, slope: np.ndarray, noise: np.ndarray) -> None:
        """Residual (m,): measured minus predicted; slope (m, states) of the prediction; noise (m, m)."""
        full = np.zeros((len(residual), self.dim))
        full[:, states] = slope
        self._residual.append(residual)
        self._slope.append(full)
        self._noise.append(noise)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All of them: (m,), (m, dim), (m, m)."""
        count = sum(len(part) for part in self._residual)
        if not count:
            return np.zeros(0), np.zeros((0, self.dim)), np.zeros((0, 0))
        noise, at = np.zeros((count, count)), 0
        for part in self._noise:
            noise[at : at + len(part), at : at + len(part)] = part
            at += len(part)
        return np.concatenate(self._residual), np.vstack(self._slope), noise


def sighting_rows(stack: Stack, x: np.ndarray, body: Body, p_WE: np.ndarray, cov: np.ndarray) -> None:
    """Caps that were sighted; NaN: not."""
    for cap in np.flatnonzero(np.all(np.isfinite(p_WE), axis=1)):
        states = body.p(int(cap))
        stack.add(states, p_WE[cap] - x[states], np.eye(3), cov[cap])


def rod_rows(stack: Stack, x: np.ndarray, body: Body, settings: MotionSettings) -> None:
    """Rods keep their length."""
    for ends, length in zip(body.rod, body.rod_length, strict=True):
        states = np.concatenate([body.p(int(ends[0])), body.p(int(ends[1]))])
        bar = x[states[3:]] - x[states[:3]]
        now = max(float(np.linalg.norm(bar)), 1e-6)
        u = bar / now
        stack.add(states, np.array([length - now]), np.concatenate([-u, u])[None], np.array([[settings.rod_sd_m**2]]))


def sensor_rows(
    stack: Stack,
    x: np.ndarray,
    body: Body,
    length: np.ndarray,
    later: np.ndarray,
    noise_sd: np.ndarray,
    delay_s: float,
) -> None:
    """Sensor lengths with offsets, shown `later` than the states [s] (negative: before), (sensor,) each.

    A length that changes may be `delay_s` old besides. One far off counts less (Huber).
    """
    for s in np.flatnonzero(np.isfinite(length)):
        a, b = (int(cap) for cap in body.sensor[s])
        pa, pb, va, vb, bias = body.p(a), body.p(b), body.v(a), body.v(b), body.bias.start + int(s)
        bar = x[pb] - x[pa] + later[s] * (x[vb] - x[va])
        now = max(float(np.linalg.norm(bar)), 1e-6)
        u = bar / now
        rate = float(u @ (x[vb] - x[va]))
        residual = float(length[s]) - now - float(x[bias])
        variance = float(noise_sd[s] ** 2 + (delay_s * rate) ** 2)
        variance *= max(abs(residual) / (6 * np.sqrt(variance)), 1.0)
        slope = np.concatenate([-u, u, -later[s] * u, later[s] * u, [1.0]])
        states = np.concatenate([pa, pb, va, vb, [bias]])
        stack.add(states, np.array([residual]), slope[None], np.array([[variance]]))


def floor_rows(stack: Stack, x: np.ndarray, body: Body, settings: MotionSettings, sd: np.ndarray) -> None:
    """No cap is below the floor; one that stands on it slips slowly. sd: of the heights [m], (cap,)."""
    for cap in range(body.caps):
        states = body.p(cap)
        height = float(x[states[2]] - body.radius[cap])
        if height < 0:
            variance = BELOW_SD_M**2 + settings.ground_sd_m**2
            stack.add(states[2:], np.array([-height]), np.ones((1, 1)), np.array([[variance]]))
        if height < ON_FLOOR_M and sd[cap] < SURE_M:
            for state in body.v(cap)[:2]:
                stack.add(np.array([state]), np.array([-x[state]]), np.ones((1, 1)), np.array([[SLIP_SD_M_PER_S**2]]))


def standing_rows(stack: Stack, x: np.ndarray, body: Body) -> None:
    """While nothing is seen: the two lowest caps stay near the floor, the robot does not fly."""
    height = body.positions(x)[:, 2] - body.radius
    for cap in np.argsort(height)[:2]:
        stack.add(body.p(int(cap))[2:], np.array([-height[cap]]), np.ones((1, 1)), np.array([[STANDING_SD_M**2]]))

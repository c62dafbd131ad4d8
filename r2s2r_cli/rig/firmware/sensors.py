"""The capacitive stretch sensors with everything that makes them dishonest."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.model.frames import cap_spans
from r2s2r_cli.rig.world.device import Sensors
from r2s2r_cli.rig.world.faults import SensorFrozen, SensorJump, SensorStuck
from r2s2r_cli.rig.world.file import World
from schemas.robot import Robot

PICO = 1e12
ADC_PF = 42.0 * 1024.0 / 3.3
"""C [pF] = this / count: 42 uA for 1 us, a 10-bit converter of 3.3 V (robot.md section 3)."""
ADC_MAX = 1023
UNSET_PF = 0.20
"""What a board sends for a chip that is not initialised."""
_MINUTE = 60.0
_PASSIVE_HALF_M = 0.05
"""A passive cable's length stays within about this of that at rest [m]."""


def nominal_calibration(robot: Robot, settings: Sensors) -> tuple[np.ndarray, np.ndarray]:
    """Slope [F/m] and offset [F] of every sensor, (sensor,): that of `robot.toml` if it has one and the world file does
    not refuse it, else that of the world file."""
    lines = []
    for sensor in robot.sensors:
        if settings.line == "own" or sensor.slope_f_per_m is None or sensor.offset_f is None:
            lines.append((settings.slope_f_per_m, settings.offset_f))
        else:
            lines.append((sensor.slope_f_per_m, sensor.offset_f))
    slope, offset = np.array(lines, dtype=float).reshape(-1, 2).T
    return slope, offset


def converted(pF: np.ndarray) -> np.ndarray:
    """Capacitances as the 10-bit converter gives them [pF]."""
    count = np.clip(np.round(ADC_PF / np.maximum(pF, 1e-3)), 1, ADC_MAX)
    return np.asarray(ADC_PF / count)


class StretchSensors:
    """All sensors of a robot. `follow` as often as the lengths are known, `read` when a board samples."""

    def __init__(self, robot: Robot, world: World, rng: np.random.Generator) -> None:
        n, settings = len(robot.sensors), world.sensors
        self._settings, self._rng = settings, rng
        self._cable = np.array([sensor.cable for sensor in robot.sensors], dtype=int)
        self._slope, self._offset = nominal_calibration(robot, settings)
        self._day = settings.day_sd_m * rng.standard_normal(n)
        self._bow = settings.bow_sd_m * rng.standard_normal(n)
        passive = np.array([robot.cables[k].kind == "passive" for k in self._cable], dtype=bool)
        self._middle = np.where(passive, cap_spans(robot)[self._cable], robot.pid.min_length_m + robot.pid.range_m / 2)
        self._half = np.where(passive, _PASSIVE_HALF_M, robot.pid.range_m / 2)
        self._walk, self._steps = [np.zeros(n)], rng.spawn(1)[0]
        self._stuck = [f for f in world.faults if isinstance(f, SensorStuck)]
        self._frozen = [f for f in world.faults if isinstance(f, SensorFrozen)]
        self._jumps = [f for f in world.faults if isinstance(f, SensorJump)]
        self._t: float | None = None
        self._x, self._y = np.zeros(n), np.zeros(n)
        self._last = np.full(n, np.nan)

    def follow(self, t: float, length: np.ndarray) -> None:
        """The sensors see `length` [m], (cable,), at time t [s]; between two calls it changes evenly."""
        x = length[self._cable]
        if self._t is None:
            self._x, self._y, self._t = x, x.copy(), t
            return
        dt = t - self._t
        if dt <= 0:
            return
        tau = self._settings.lag_s
        if tau > 0:
            # The exact answer of a first-order lag to a ramp.
            behind = tau * (x - self._x) / dt
            self._y = x - behind + (self._y - self._x + behind) * np.exp(-dt / tau)
        else:
            self._y = x.copy()
        self._x, self._t = x, t

    @property
    def working_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Shortest and longest length of the working range of every sensor [m], (sensor,)."""
        return self._middle - self._half, self._middle + self._half

    def on_the_bench(self, length: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Capacitances [pF] of sensors that are held at `length` [m], (sensor,), on a day without offset and drift."""
        noise = self._settings.noise_sd_m * rng.standard_normal(len(length))
        return self._pF(self._bent(length) + noise, np.arange(len(length)))

    def _bent(self, length: np.ndarray) -> np.ndarray:
        s = np.clip((length - self._middle) / self._half, -1.0, 1.0)
        return np.asarray(length + self._bow * (2.0 * s * s - 1.0))

    def _pF(self, shown: np.ndarray, i: np.ndarray) -> np.ndarray:
        pF = PICO * (self._slope[i] * shown + self._offset[i])
        return converted(pF) if self._settings.converter == "10 bit" else np.asarray(pF)

    def _drift(self, t: float) -> np.ndarray:
        """At the rig's time t [s]: a walk from second to second, straight in between, however often it is asked for."""
        whole, part = divmod(max(t, 0.0), 1.0)
        k = int(whole)
        while len(self._walk) < k + 2:
            step = self._steps.standard_normal(len(self._cable)) / np.sqrt(_MINUTE)
            self._walk.append(self._walk[-1] + self._settings.drift_sd_m * step)
        return np.asarray((1.0 - part) * self._walk[k] + part * self._walk[k + 1])

    def read(self, t: float, which: tuple[int, ...]) -> np.ndarray:
        """Capacitances of some sensors [pF], in that order."""
        i = np.array(which, dtype=int)
        shown = self._bent(self._y)[i] + self._day[i] + self._drift(t)[i]
        for jump in self._jumps:
            if jump.on(t):
                shown = shown + np.where(i == jump.sensor, jump.by_m, 0.0)
        shown = shown + self._settings.noise_sd_m * self._rng.standard_normal(len(i))
        pF = self._pF(shown, i)
        again = (self._rng.random(len(i)) < self._settings.dropout_share) & np.isfinite(self._last[i])
        for frozen in self._frozen:
            if frozen.on(t):
                again = again | ((i == frozen.sensor) & np.isfinite(self._last[i]))
        pF = np.where(again, self._last[i], pF)
        self._last[i] = pF
        for stuck in self._stuck:
            if stuck.on(t):
                pF = np.where(i == stuck.sensor, UNSET_PF, pF)
        return pF

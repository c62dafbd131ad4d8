"""Between the orders and signs of robot.toml and those of the wire, and many messages into one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.devices.link import Sample
from r2s2r_cli.hardware.codec.base import Reading

if TYPE_CHECKING:
    from schemas.robot import Robot

_OVERDUE = 1.5
_EARLY = 0.5
"""Periods after the last control tick: beyond the first, any board may call for one; before the second, none."""


@dataclass(frozen=True)
class Wiring:
    """motor: for every winched cable, the wire's number of its motor, (actuated,). scale: duty at speed 1, (actuated,).

    sensors: how many.
    """

    motor: np.ndarray
    scale: np.ndarray
    sensors: int

    @classmethod
    def of(cls, robot: Robot) -> Wiring:
        """Of a robot description: motors of the wire are in the order of [[motors]]."""
        number = {motor.cable: i for i, motor in enumerate(robot.motors)}
        order = [number[cable] for cable in robot.actuated]
        return cls(
            motor=np.array(order, dtype=np.int64),
            scale=np.array([robot.motors[i].sign * robot.motors[i].speed for i in order]),
            sensors=len(robot.sensors),
        )

    def duty(self, speed: np.ndarray) -> np.ndarray:
        """Duties of the wire, (motor,), of speeds +1 reels in, (actuated,). Raises ValueError unless in -1 .. 1."""
        speed = np.asarray(speed, dtype=np.float64)
        if speed.shape != self.scale.shape:
            raise ValueError(f"expected {len(self.scale)} speeds, received an array of shape {speed.shape}")
        if not np.isfinite(speed).all() or (np.abs(speed) > 1).any():
            raise ValueError(f"speeds must lie in -1 to 1, received {speed.tolist()}")
        duty = np.zeros(len(self.motor))
        duty[self.motor] = speed * self.scale
        return duty


class Picture:
    """The latest of every sensor, and when a control tick is due."""

    def __init__(self, wiring: Wiring, period: float) -> None:
        self._wiring = wiring
        self._period = period
        self.restart()

    def restart(self) -> None:
        """Nothing received yet."""
        n = self._wiring.sensors
        self._capacitance, self._t = np.full(n, np.nan), np.full(n, np.nan)
        self._leader: int | None = None
        self._last_due = -np.inf

    def add(self, reading: Reading, t: float, *, due: bool | None = None) -> Sample:
        """The sample of a message that came at t [s]. due: where the caller knows it (lock-step)."""
        fresh = np.isfinite(reading.capacitance)
        self._capacitance = np.where(fresh, reading.capacitance, self._capacitance)
        self._t = np.where(fresh, t, self._t)
        return Sample(
            t_host=t, board=reading.board, t_board=reading.t_board,
            due=self._due(reading, t) if due is None else due, capacitance=self._capacitance.copy(),
            t_sensor=self._t.copy(), fresh=fresh, encoder=reading.encoder[self._wiring.motor],
            a_B=reading.a_B, w_WB=reading.w_WB, voltage=reading.voltage,
        )  # fmt: skip

    def _due(self, reading: Reading, t: float) -> bool:
        """One board leads; where it falls silent another takes over. Two that come at once are one tick."""
        if not reading.measures:
            return False
        since = (t - self._last_due) / self._period
        if self._leader is None or since > _OVERDUE:
            self._leader = reading.board
        if reading.board != self._leader or since < _EARLY:
            return False
        self._last_due = t
        return True

"""What both protocols of the authors share: numbers as Arduino prints them, and the wire's speed range."""

from __future__ import annotations

import re

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.hardware.codec.base import Event, LockStep, TickDone, checked_duty

FULL = 99
"""Wire speed of the full PWM."""
ADC = 42 * 1024 / 3.3 * 1e-12
"""Capacitance [F] times the count of the sensor chip: 42 uA for 1 us on a 10-bit scale of 3.3 V."""
SENSORS, MOTORS = 9, 6
CANNOT_STOP = (
    "this protocol cannot guarantee a stop: the robot keeps its last command when the host or the link dies; "
    "keep a hand on its switch"
)
_NUMBER = re.compile(r"-?[0-9]{1,12}(\.[0-9]{1,6})?")
_NOT_FINITE = frozenset({"nan", "inf", "-inf", "ovf", "-ovf"})
_ANNOUNCED = re.compile(rb"#lockstep ([0-9]{1,9})")
_TICK = re.compile(rb"#tick ([0-9]{1,12}) ([0-9]{1,18})")


def number(token: str) -> float:
    """A number of a line; NaN for what Arduino prints of one that is not finite. Raises ValueError."""
    if token in _NOT_FINITE:
        return float("nan")
    if not _NUMBER.fullmatch(token):
        raise ValueError(f"no number: {token[:20]!r}")
    return float(token)


def wire_speeds(duty: np.ndarray) -> np.ndarray:
    """Duties of the six motors as speeds of the wire, -99 .. 99. Raises ValueError for numbers out of range."""
    return checked_duty(duty, MOTORS) * FULL


def rig_line(line: bytes) -> Event | None:
    """What only a rig in lock-step says; None: something else."""
    if match := _ANNOUNCED.fullmatch(line):
        return LockStep(period=int(match[1]) / 1e6)
    if match := _TICK.fullmatch(line):
        return TickDone(k=int(match[1]), t=int(match[2]) / 1e6)
    return None


def refuse_other_robots(name: str, sensors: int, motors: int) -> None:
    """Raises UsageError for a robot that does not have nine sensors and six motors."""
    if (sensors, motors) != (SENSORS, MOTORS):
        raise UsageError(f"the protocol {name} carries nine sensors and six motors", where="--protocol",
                         expected=f"{SENSORS} sensors, {MOTORS} motors", received=f"{sensors} sensors, {motors} motors",
                         hint="--protocol checked")  # fmt: skip

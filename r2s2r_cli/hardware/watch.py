"""What of the sensors must stop the robot. Pure: samples in, a reason or "" out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.devices.lengths import Lengths, believed, not_initialised
from r2s2r_cli.devices.link import Sample

if TYPE_CHECKING:
    from schemas.robot import Robot

STALE = 0.2
"""[s] after which a reading is too old to drive on."""
DOUBTED = 0.18
"""[s] that a winch is driven without any change of its sensor, after which the motors are held: a sensor may be frozen,
and with what the next reading and the way of the stop take they are off within 250 ms ..."""
DOUBTED_PATH = 0.004
"""... if the winch was driven through this [m]: four steps of the authors' 10-bit converter. A healthy sensor in motion
changes with nearly every reading, one whose cable is held back by its noise (0.18 s without a change did not occur in
390 s of driving on the rig) ..."""
FROZEN = 0.8
"""[s], driven or held, after which it is frozen for certain. Not less: at rest the 10-bit converter sends the same
value up to 18 times in a row (measured on the rig's, in 1,000 readings of noise 0.55 mm), and was merely doubted."""
OUT_FOR = 3
"""Messages in a row: one bad number is no reason."""
_ROUNDING = 1e-9
"""[s]: ticks of 20 ms add up to a little less or more."""


class Watch:
    """The sensors of the winched cables, and the boards."""

    def __init__(self, robot: Robot, lengths: Lengths) -> None:
        by_cable = {sensor.cable: i for i, sensor in enumerate(robot.sensors)}
        self._cables = [cable for cable in robot.actuated if cable in by_cable]
        self._sensors = np.array([by_cable[cable] for cable in self._cables], dtype=np.int64)
        self._motor = np.array([robot.actuated.index(cable) for cable in self._cables], dtype=np.int64)
        motors = {motor.cable: motor for motor in robot.motors}
        self._speed = np.array([
            motors[c].no_load_rad_per_s * motors[c].speed * motors[c].winch_radius_m for c in self._cables
        ])  # fmt: skip
        self._lengths = lengths
        self._limits = robot.limits
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Forget what was; now [s]: from here on the sensors are awaited."""
        n = len(self._sensors)
        self._good = np.full(n, now)
        self._out = np.zeros(n, dtype=np.int64)
        self._value, self._raw = np.full(n, np.nan), np.full(n, np.nan)
        self._unchanged, self._path = np.zeros(n), np.zeros(n)
        self._doubted = np.zeros(n, dtype=bool)
        self._last = now

    def sample(self, sample: Sample, moving: np.ndarray) -> str:
        """Look at a sample that came while the motors had these speeds, (actuated,). A reason to stop, or ""."""
        now, value, fresh = sample.t_host, sample.capacitance[self._sensors], sample.fresh[self._sensors]
        self._raw = np.where(fresh, value, self._raw)
        good = fresh & ~np.isnan(value) & ~not_initialised(value)
        self._good = np.where(good, now, self._good)
        frozen = self._frozen(now, value, good, np.abs(moving[self._motor]))
        if frozen.any():
            return f"frozen sensor: that of cable {self._name(frozen)} has not changed while its motor ran"
        return self._range(sample.capacitance, good)

    @property
    def doubt(self) -> str:
        """Why the motors should be held for now, "" nothing: a sensor that may be frozen. Goes when it changes."""
        return f"the sensor of cable {self._name(self._doubted)} may be frozen" if self._doubted.any() else ""

    def _frozen(self, now: float, value: np.ndarray, good: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """Which sensors are, (watched,), bool; those that may be are doubted. moving: size of the speed, (watched,)."""
        passed = max(0.0, now - self._last)
        self._last = max(now, self._last)
        changed = good & (value != self._value)
        self._value = np.where(changed, value, self._value)
        tested = (moving > 0) | self._doubted
        self._unchanged = np.where(changed, 0.0, self._unchanged + np.where(tested, passed, 0.0))
        self._path = np.where(changed, 0.0, self._path + moving * self._speed * passed)
        # Judged at a reading of its own: what is not heard is stale, not frozen.
        seems = good & (self._unchanged > DOUBTED - _ROUNDING) & (self._path > DOUBTED_PATH)
        self._doubted = (self._doubted | seems) & ~changed
        return self._doubted & good & (self._unchanged > FROZEN)

    def stale(self, now: float) -> str:
        """A reason to stop at the time `now` [s]: a sensor without a good reading for too long."""
        late = now - self._good > STALE
        if not late.any():
            return ""
        stuck = late & not_initialised(self._raw)
        if stuck.any():
            return f"sensor not set up: that of cable {self._name(stuck)} sends 0.20 pF"
        return f"stale sensors: no good reading of cable {self._name(late)} for {STALE * 1e3:.0f} ms"

    def _range(self, capacitance: np.ndarray, good: np.ndarray) -> str:
        length = self._lengths(capacitance)[self._cables]
        out = good & np.isnan(believed(length, self._limits))
        self._out = np.where(good, np.where(out, self._out + 1, 0), self._out)
        over = self._out >= OUT_FOR
        if not over.any():
            return ""
        k = int(np.flatnonzero(over)[0])
        return (
            f"length out of range: cable {self._cables[k]} measures {length[k] * 1e3:.0f} mm, "
            f"limits {self._limits.cable_length_min_m * 1e3:.0f} to {self._limits.cable_length_max_m * 1e3:.0f} mm"
        )

    def _name(self, which: np.ndarray) -> str:
        return ", ".join(str(self._cables[k]) for k in np.flatnonzero(which))

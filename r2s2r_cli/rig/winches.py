"""Motors and winches: from the PWM of the drivers to the rest lengths of the cables.

Without laws a winch is ideal: its shaft turns at once with no_load x duty, whatever pulls at the cable.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import Law, overrides
from r2s2r_cli.rig.model.frames import rest_pose
from r2s2r_cli.rig.model.mjcf_text import winch_range
from schemas.robot import Robot


class Winches:
    """The motors of a robot. Arrays have the order of `Robot.actuated`, but for `duty` (that of `Robot.motors`).

    angle: shaft angles [rad], 0 in the rest pose, positive wound up. rest: rest lengths that the winches have set [m].
    acting: those that act on the robot [m]. w: shaft speeds [rad/s]. share: battery voltage as a share of nominal.
    """

    def __init__(self, robot: Robot) -> None:
        place = {cable: i for i, cable in enumerate(robot.actuated)}
        self.order = np.array([place[motor.cable] for motor in robot.motors], dtype=int)
        """Place in `Robot.actuated` of every motor."""
        self._sign = np.array([motor.sign for motor in robot.motors], dtype=float)
        n = len(robot.actuated)
        self._full, self.r = np.zeros(n), np.zeros(n)
        self._full[self.order] = [motor.no_load_rad_per_s for motor in robot.motors]
        self.r[self.order] = [motor.winch_radius_m for motor in robot.motors]
        self._low, self._high = winch_range(robot).T
        self.rest = np.clip(rest_pose(robot).rest, self._low, self._high)
        self.acting = self.rest.copy()
        self.angle, self.w = np.zeros(n), np.zeros(n)
        self.share = 1.0

    def use(self, laws: tuple[Law, ...]) -> None:
        """The laws that hold from now on."""
        self._command, self._volts, self._turn, self._radius, self._rest = (
            tuple(law for law in laws if overrides(law, hook))
            for hook in ("command", "volts", "turn", "radius", "rest")
        )
        self._always = bool(self._turn or self._rest or self._volts)

    def turn(self, t: float, dt: float, duty: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Turn for dt [s] from time t on; gives the rest lengths that act after it [m].

        duty: -1 .. 1 with the sign of the wire, (motor,); tension of the winched cables [N].
        """
        u = np.zeros(len(self.r))
        u[self.order] = self._sign * duty
        for law in self._command:
            u = law.command(t, u)
        if not (self._always or u.any()):
            self.w = u
            return self.acting
        self.share = 1.0
        for law in self._volts:
            self.share = law.volts(dt, self.share, np.abs(u))
        w = self._full * u * self.share
        for law in self._turn:
            w = law.turn(dt, w, tension)
        r = self.r
        for law in self._radius:
            r = law.radius(self.angle, r)
        rest = np.clip(self.rest - r * w * dt, self._low, self._high)
        # At either end of its travel a winch stalls: its shaft turns no further than its cable.
        self.w = (self.rest - rest) / (r * dt)
        self.angle = self.angle + self.w * dt
        self.rest = self.acting = rest
        for law in self._rest:
            self.acting = law.rest(dt, self.acting, tension)
        return self.acting

"""What a law of the rig can reach, and the places in a step where it can act.

Order within a step: `command` (what reaches the drivers), `volts`, `turn` (shaft speed), `radius` (of the spool),
`rest` (rest length that acts), `force` and `friction` (before MuJoCo's step). `sense` acts when a sensor is read. A law
that changes the model for good does so once, when it is made; one of the camera changes the camera's table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.model.options import Options
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.section import Section
from schemas.robot import Robot


@dataclass(frozen=True)
class Scene:
    """What a law is made with. r: winch radii [m], (actuated,); rng: the law's own."""

    robot: Robot
    sim: MujocoSim
    r: np.ndarray
    rng: np.random.Generator


class Law:
    """One effect at work. Arrays of winches have the order of `Robot.actuated`; a law overrides the hooks it uses."""

    def command(self, t: float, u: np.ndarray) -> np.ndarray:
        """Drive u in -1 .. 1, +1 reels in, that the motors really get at time t [s]."""
        return u

    def volts(self, dt: float, share: float, load: np.ndarray) -> float:
        """Battery voltage as a share of nominal; load: currents as shares of those at a stall, (actuated,)."""
        return share

    def turn(self, dt: float, w: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Shaft speeds [rad/s]; tension of the winched cables [N]."""
        return w

    def radius(self, angle: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Radii of the spools [m] at shaft angles [rad], 0 in the rest pose, positive wound up."""
        return r

    def rest(self, dt: float, rest: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Rest lengths that act on the robot [m], from those that the winches have set."""
        return rest

    def force(self, t: float) -> None:
        """Add forces to `sim.data.xfrc_applied`, which is zero before the first law."""

    def friction(self, mu: np.ndarray) -> np.ndarray:
        """Coulomb coefficients of the caps, (cap,)."""
        return mu

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        """Lengths that the sensors are stretched to [m], (cable,)."""
        return length


class EffectSection(Section):
    """The table of one effect: its numbers, and how to make its law."""

    def options(self, options: Options) -> Options:
        """Options of the model, where the effect is one."""
        return options

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """Settings of the camera, where the effect is one of its own."""
        return camera

    def law(self, scene: Scene) -> Law:
        """The law at work on a robot; by default one that uses no hook."""
        return Law()


def overrides(law: Law, hook: str) -> bool:
    """Whether a law uses a hook: only those are called."""
    return getattr(type(law), hook) is not getattr(Law, hook)


def per(values: tuple[float, ...], n: int, fill: float) -> np.ndarray:
    """Numbers of a table, one an element; missing ones at the end are `fill`."""
    return np.array((*values, *(fill,) * n)[:n], dtype=float)

"""What a law of the rig can reach, and the places in a step where it can act.

Order within a step: `command` (what reaches the drivers), `volts`, `turn` (shaft speed), `radius` (of the spool),
`rest` (rest length that acts), `force` and `friction` (before MuJoCo's step). `sense` acts when a sensor is read,
`see` when the camera looks. A law that changes the model for good does so once, in its constructor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

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


@dataclass(frozen=True)
class View:
    """How the camera differs, for one frame, from what its table says: turned by R_CC (3, 3) and moved by p_CC [m],
    (3,), both in the axes of frame C; depth times `scale`; the scene as it was `delay` [s] ago; `lost`: this frame
    never comes."""

    p_CC: np.ndarray
    R_CC: np.ndarray
    scale: float = 1.0
    delay: float = 0.0
    lost: bool = False


STRAIGHT = View(np.zeros(3), np.eye(3))
"""The camera is what its table says."""


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

    def see(self, t: float, view: View) -> View:
        """How the camera stands for the frame at time t; called once a frame."""
        return view


class EffectSection(Section):
    """The table of one effect: its numbers, and how to make its law."""

    def options(self, options: Options) -> Options:
        """Options of the model, where the effect is one."""
        return options

    def law(self, scene: Scene) -> Law:
        """The law at work on a robot."""
        raise NotImplementedError


def overrides(law: Law, hook: str) -> bool:
    """Whether a law uses a hook: only those are called."""
    return getattr(type(law), hook) is not getattr(Law, hook)


def per(values: tuple[float, ...], n: int, fill: float) -> np.ndarray:
    """Numbers of a table, one an element; missing ones at the end are `fill`."""
    return np.array((*values, *(fill,) * n)[:n], dtype=float)


def with_delay(view: View, delay: float) -> View:
    """The view, later."""
    return replace(view, delay=view.delay + delay)

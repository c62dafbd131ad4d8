"""What a MuJoCo model needs to know beyond `robot.toml`: step, solver, ground, and how hard a contact is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from r2s2r_cli.errors import UsageError

Vector = tuple[float, float, float]
Cone = Literal["elliptic", "pyramidal"]
Integrator = Literal["Euler", "implicitfast"]


@dataclass(frozen=True)
class Ridge:
    """A round bar that lies fixed on the ground: a line from a to b [m], frame W, and its radius [m]."""

    a: Vector
    b: Vector
    radius: float


@dataclass(frozen=True, kw_only=True)
class Options:
    """World and numerics. The defaults are close to MuJoCo's own; `STIFF` is for comparisons."""

    timestep_s: float = 0.001
    gravity: Vector = (0.0, 0.0, -9.81)
    """[m/s^2], frame W."""
    ground_normal: Vector = (0.0, 0.0, 1.0)
    """Upwards from the ground, frame W; of any length above 0."""
    ground_offset_m: float = 0.0
    """Distance of the ground plane from the origin of W along its normal."""
    ridges: tuple[Ridge, ...] = ()
    """Part of the ground: of its friction, met by caps alone."""
    friction: float | None = None
    """Coulomb coefficient of caps on the ground; None: that of robot.toml."""
    restitution: float | None = None
    """None: that of robot.toml. MuJoCo has no such number: it becomes a damping ratio, and rebounds are a little
    too low (0.46 for 0.5, 0.68 for 0.7: tests/rig/test_contact.py)."""
    rod_contact: bool = True
    """Rods collide: shafts as capsules, caps as spheres."""
    rod_friction: float = 0.3
    """Coulomb coefficient between rods."""
    movable_mass: bool = False
    """Bodies compiled so that masses may be changed afterwards; MuJoCo else leaves out what a body with its centre of
    mass in its origin does not need."""
    cone: Cone = "elliptic"
    integrator: Integrator = "Euler"
    """`implicitfast` leaves out of its implicit damping what couples two free bodies: cables then brake their rods
    against the world, and the falling robot is 5 per cent too slow at 1 ms (tests/rig/test_motion.py)."""
    impratio: float = 1.0
    """Hardness of friction against that of the normal; large values creep less."""
    contact_time_s: float = 0.004
    """1 / natural frequency of a contact [s/rad]; MuJoCo cannot resolve less than two steps."""
    impedance: tuple[float, float, float] = (0.9, 0.95, 0.001)
    """MuJoCo's solimp: impedance at the surface and in the depth, and the depth [m] where it is reached."""

    def __post_init__(self) -> None:
        for name in ("timestep_s", "impratio", "contact_time_s"):
            _require(name, getattr(self, name), "above 0", getattr(self, name) > 0)
        for name in ("friction", "rod_friction"):
            value = getattr(self, name)
            _require(name, value, "at least 0", value is None or value >= 0)
        e = self.restitution
        _require("restitution", e, "from 0 to 1", e is None or 0 <= e <= 1)
        for name, known in (("cone", get_args(Cone)), ("integrator", get_args(Integrator))):
            _require(name, getattr(self, name), " | ".join(known), getattr(self, name) in known)
        near, far, depth = self.impedance
        _require("impedance", self.impedance, "two shares above 0 and below 1, and a depth above 0",
                 0 < near < 1 and 0 < far < 1 and depth > 0)  # fmt: skip
        length = float(np.linalg.norm(self.ground_normal))
        _require("ground_normal", self.ground_normal, "a direction", length > 0)
        _require("gravity", self.gravity, "finite numbers", bool(np.isfinite(self.gravity).all()))
        _require("ground_offset_m", self.ground_offset_m, "a finite number", math.isfinite(self.ground_offset_m))


_LEAST_RATIO = 1e-3
"""Rebounds with 0.997; none at all cannot be written as a time constant."""


def damping_ratio(restitution: float) -> float:
    """Damping ratio of the spring and damper that, released when it would pull, rebounds with `restitution`.

    Schwager and Poeschel, Granular Matter 9 (2007) 465. The critical ratio 1 rebounds with exp(-2) = 0.135; what is
    asked for below that gets 1, MuJoCo's own choice, whose rebound its soft constraint and finite step swallow mostly.
    """
    if restitution <= math.exp(-2.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _rebound(middle) > restitution else (low, middle)
    return max((low + high) / 2, _LEAST_RATIO)


def _rebound(ratio: float) -> float:
    """Coefficient of restitution of a unilateral spring and damper with a damping ratio below 1."""
    root = math.sqrt(1.0 - ratio * ratio)
    angle = math.atan2(2.0 * ratio * root, 2.0 * ratio * ratio - 1.0)
    return math.exp(-ratio / root * angle)


def _require(name: str, value: object, expected: str, good: bool) -> None:
    if not good:
        raise UsageError(
            f"{name} cannot be {value}", where=f"options of the MuJoCo model: {name}", expected=expected,
            received=str(value), hint=f"leave {name} out for its default",
        )  # fmt: skip


STIFF = Options(timestep_s=0.00025, impratio=100.0, contact_time_s=0.0005, impedance=(0.99, 0.999, 0.0001))
"""Contacts nearly as hard as the engine's impulses (contact.md section 5), for comparisons of the two."""

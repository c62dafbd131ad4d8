"""Effects of friction: by place, by cap, by speed. Each gives a coefficient a cap, anew in every step."""

from __future__ import annotations

import mujoco
import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.effects.contact import cap_geoms
from r2s2r_cli.rig.section import NonNegative, Positive, Real, Section, Vector2


class Patch(Section):
    """A round place of another friction."""

    center_m: Vector2
    """[m], frame W."""
    radius_m: Positive
    """Where it is half faded out [m]."""
    factor: NonNegative = 0.4
    """Of the coefficient in the middle."""
    edge_m: Positive = 0.02
    """Width over which it fades out at the rim [m]."""


class FrictionField(EffectSection):
    """Friction depends on the place: patches, and a gradient across the floor."""

    patches: tuple[Patch, ...] = ()
    """Round places of another friction."""
    gradient_per_m: Vector2 = (0.0, 0.0)
    """Relative change of the coefficient a metre along x and y [1/m]; it stays between 0.1 and 3 times itself."""

    def law(self, scene: Scene) -> Law:
        """Discs with a soft rim, where the catalogue has a gradient or a patch."""
        return _Field(self, scene)


class _Field(Law):
    def __init__(self, p: FrictionField, scene: Scene) -> None:
        self._p, self._data, self._geoms = p, scene.sim.data, cap_geoms(scene.sim, scene.robot.n_caps)

    def friction(self, mu: np.ndarray) -> np.ndarray:
        xy = self._data.geom_xpos[self._geoms, :2]
        mu = mu * np.clip(1.0 + xy @ np.array(self._p.gradient_per_m), 0.1, 3.0)
        for patch in self._p.patches:
            away = np.linalg.norm(xy - np.array(patch.center_m), axis=1)
            inside = np.clip((patch.radius_m - away) / patch.edge_m + 0.5, 0.0, 1.0)
            mu = mu * (1.0 + (patch.factor - 1.0) * inside)
        return mu


class CapFriction(EffectSection):
    """Single caps grip more or less: worn, or dirty."""

    factors: tuple[NonNegative, ...]
    """One a cap; missing ones are 1."""

    def law(self, scene: Scene) -> Law:
        """A constant factor a cap."""
        return _Grip(per(self.factors, scene.robot.n_caps, 1.0))


class _Grip(Law):
    def __init__(self, factors: np.ndarray) -> None:
        self._factors = factors

    def friction(self, mu: np.ndarray) -> np.ndarray:
        return mu * self._factors


class Stribeck(EffectSection):
    """A cap at rest grips more than one that slides."""

    static_factor: Positive = 1.4
    """Coefficient at rest against that of a fast slip."""
    speed_m_per_s: Positive = 0.02
    """Speed of slip at which a third of the difference is left [m/s]."""

    def law(self, scene: Scene) -> Law:
        """Exponential in the speed of the point that touches."""
        return _Slide(self, scene)


class _Slide(Law):
    def __init__(self, p: Stribeck, scene: Scene) -> None:
        self._p, self._soles = p, Soles(scene)

    def friction(self, mu: np.ndarray) -> np.ndarray:
        speed = np.linalg.norm(self._soles.velocity(), axis=1)
        return mu * (1.0 + (self._p.static_factor - 1.0) * np.exp(-speed / self._p.speed_m_per_s))


class FrictionAnisotropy(EffectSection):
    """A brushed carpet: it grips more across its pile than along it, and more against the nap than with it."""

    angle_rad: Real = 0.0
    """Direction of the nap in the plane, from the world's x axis [rad]."""
    across: NonNegative = 0.4
    """How much the coefficient rises across the pile, and falls along it, as a part of it."""
    against: NonNegative = 0.2
    """How much it rises against the nap, and falls with it, as a part of it."""

    def law(self, scene: Scene) -> Law:
        """First and second harmonic of the direction of slip, where the catalogue has an ellipse."""
        return _Pile(self, scene)


class _Pile(Law):
    _CREEP = 1e-3
    """Speed below which a slip has no direction yet [m/s]."""

    def __init__(self, p: FrictionAnisotropy, scene: Scene) -> None:
        self._p, self._soles = p, Soles(scene)

    def friction(self, mu: np.ndarray) -> np.ndarray:
        v = self._soles.velocity()
        angle = np.arctan2(v[:, 1], v[:, 0]) - self._p.angle_rad
        share = np.tanh(np.linalg.norm(v, axis=1) / self._CREEP)
        change = -self._p.across * np.cos(2.0 * angle) - self._p.against * np.cos(angle)
        return mu * np.maximum(1.0 + share * change, 0.05)


class Soles:
    """The points of the caps that touch the floor, or would."""

    def __init__(self, scene: Scene) -> None:
        model = scene.sim.model
        self._data, self._geoms = scene.sim.data, cap_geoms(scene.sim, scene.robot.n_caps)
        self._bodies = model.geom_bodyid[self._geoms]
        flat = np.zeros(9)
        mujoco.mju_quat2Mat(flat, model.geom_quat[model.geom("ground").id])
        self._normal = flat.reshape(3, 3)[:, 2]
        self._down = -model.geom_size[self._geoms, :1] * self._normal

    def velocity(self) -> np.ndarray:
        """Along the floor, in frame W [m/s], (cap, 3)."""
        data, rods = self._data, len(self._geoms) // 2
        twist = data.qvel.reshape(rods, 6)
        R_WR = data.xmat[self._bodies[::2]].reshape(rods, 3, 3)
        w_W = np.einsum("rij,rj->ri", R_WR, twist[:, 3:])
        arm = data.geom_xpos[self._geoms] - data.xpos[self._bodies] + self._down
        v = np.repeat(twist[:, :3], 2, axis=0) + np.cross(np.repeat(w_W, 2, axis=0), arm)
        return np.asarray(v - (v @ self._normal)[:, None] * self._normal)

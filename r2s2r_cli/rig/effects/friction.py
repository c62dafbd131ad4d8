"""Effects of friction: by place, by cap, by speed. Each gives a coefficient a cap, anew in every step."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.effects.contact import cap_geoms
from r2s2r_cli.rig.section import NonNegative, Positive, Section, Vector2


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
        """Exponential in the speed of the cap's centre along the ground."""
        return _Slide(self, scene)


class _Slide(Law):
    def __init__(self, p: Stribeck, scene: Scene) -> None:
        self._p, self._data, self._geoms = p, scene.sim.data, cap_geoms(scene.sim, scene.robot.n_caps)
        self._dt = scene.sim.model.opt.timestep
        self._before: np.ndarray | None = None

    def friction(self, mu: np.ndarray) -> np.ndarray:
        xy = np.array(self._data.geom_xpos[self._geoms, :2])
        speed = np.zeros(len(xy)) if self._before is None else np.linalg.norm(xy - self._before, axis=1) / self._dt
        self._before = xy
        return mu * (1.0 + (self._p.static_factor - 1.0) * np.exp(-speed / self._p.speed_m_per_s))

"""Effects of the surroundings: slope, tether, air, sticky floor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Self

import mujoco
import numpy as np
from pydantic import Field, model_validator

from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder, Rgb
from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene
from r2s2r_cli.rig.effects.contact import cap_geoms
from r2s2r_cli.rig.model.mjcf_text import ground_rotation
from r2s2r_cli.rig.model.options import Options, Ridge
from r2s2r_cli.rig.section import Index, NonNegative, Place, Slope, Vector3

_SHORTEST_M = 1e-6
"""MuJoCo takes no shorter bar."""


class GroundSlope(EffectSection):
    """The floor is not level. W stays upright: it is the floor that is turned, about the origin of W."""

    angle_x_rad: Slope = 0.0
    """Turn about the world's x axis [rad] ..."""
    angle_y_rad: Slope = 0.0
    """... and after it about the world's y axis [rad]."""

    def options(self, options: Options) -> Options:
        """A turned plane, where the catalogue turns gravity."""
        return replace(options, ground_normal=self.normal())

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """The floor is seen as it lies."""
        return camera.model_copy(update={"floor_normal": self.normal()})

    def normal(self) -> Vector3:
        """Of the floor, frame W."""
        x, y, z = 0.0, -math.sin(self.angle_x_rad), math.cos(self.angle_x_rad)
        a = self.angle_y_rad
        return (math.cos(a) * x + math.sin(a) * z, y, math.cos(a) * z - math.sin(a) * x)


class Obstacle(EffectSection):
    """A ridge: a round bar that lies half sunk in the floor."""

    from_m: tuple[Place, Place] = (0.2, -0.5)
    """Where it begins [m], along the floor ..."""
    to_m: tuple[Place, Place] = (0.2, 0.5)
    """... and where it ends [m]."""
    height_m: Annotated[float, Field(strict=True, gt=0, le=0.1)] = 0.01
    """How far it stands out of the floor: its radius [m]."""
    rgb: Rgb = (90, 85, 80)
    """Its colour in the picture."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if math.dist(self.from_m, self.to_m) < _SHORTEST_M:
            raise ValueError("from_m and to_m are one point")
        return self

    def options(self, options: Options) -> Options:
        """A capsule of MuJoCo's in the plane of the floor, whatever its slope."""
        a, b = self.ends(options.ground_normal)
        return replace(options, ridges=(*options.ridges, Ridge(a, b, self.height_m)))

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """It is in the picture."""
        a, b = self.ends(camera.floor_normal)
        bar = Occluder(a_m=a, b_m=b, radius_m=self.height_m, rgb=self.rgb)
        return camera.model_copy(update={"occluders": (*camera.occluders, bar)})

    def ends(self, normal: Vector3) -> tuple[Vector3, Vector3]:
        """In frame W [m], on a floor with this normal."""
        R_WG = ground_rotation(normal)
        a, b = (R_WG @ np.array([*xy, 0.0]) for xy in (self.from_m, self.to_m))
        return (a[0], a[1], a[2]), (b[0], b[1], b[2])


class TetherDrag(EffectSection):
    """A cable hangs from the robot to a fixed point: the farther away, the more of it is lifted and pulls."""

    anchor_m: Vector3 = (0.0, 0.0, 1.5)
    """Where the tether is fixed [m], frame W."""
    free_m: NonNegative = 1.5
    """Up to this distance only the hanging weight pulls, downwards [m]."""
    weight_n: NonNegative = 0.05
    """Hanging weight [N]."""
    stiffness_n_per_m: NonNegative = 1.0
    """Pull towards the anchor a metre beyond `free_m` [N/m]."""
    largest_n: NonNegative = 0.5
    """The pull towards the anchor grows no further [N]."""
    rod: Index = 0
    """Tied to the middle of this rod."""

    def law(self, scene: Scene) -> Law:
        """Weight and spring, where the catalogue has a constant force towards the anchor."""
        return _Tether(self, scene)


class _Tether(Law):
    def __init__(self, p: TetherDrag, scene: Scene) -> None:
        self._p, self._sim = p, scene.sim
        self._body = scene.sim.model.body("rod_" + scene.robot.rods[p.rod].name).id

    def force(self, t: float) -> None:
        data, p = self._sim.data, self._p
        point = np.array(data.xpos[self._body])
        away = np.array(p.anchor_m) - point
        distance = float(np.linalg.norm(away))
        pull = min(p.stiffness_n_per_m * max(distance - p.free_m, 0.0), p.largest_n)
        f = pull * away / max(distance, 1e-9) + np.array([0.0, 0.0, -p.weight_n])
        data.xfrc_applied[self._body, :3] += f
        data.xfrc_applied[self._body, 3:] += np.cross(point - data.xipos[self._body], f)


class AirDrag(EffectSection):
    """The air, or something thicker."""

    density_kg_per_m3: NonNegative = 1.2
    """Of the fluid [kg/m^3]."""
    viscosity_pa_s: NonNegative = 1.8e-5
    """Of the fluid [Pa s]."""

    def law(self, scene: Scene) -> Law:
        """MuJoCo's fluid: quadratic and viscous drag of a box with the body's inertia, a law no catalogue has."""
        opt = scene.sim.model.opt
        opt.density, opt.viscosity = self.density_kg_per_m3, self.viscosity_pa_s
        return Law()


class ViscousContact(EffectSection):
    """A sticky floor: what touches it is braked in proportion to its speed along it."""

    drag_n_s_per_m: NonNegative = 1.0
    """A cap that touches [N s/m]."""

    def law(self, scene: Scene) -> Law:
        """Forces at the caps that touch."""
        return _Sticky(self, scene)


class _Sticky(Law):
    def __init__(self, p: ViscousContact, scene: Scene) -> None:
        self._c, self._sim, self._geoms = p.drag_n_s_per_m, scene.sim, cap_geoms(scene.sim, scene.robot.n_caps)
        model = scene.sim.model
        self._body = model.geom_bodyid[self._geoms]
        self._r = model.geom_size[self._geoms, 0]
        ground = model.geom("ground").id
        self._normal = np.zeros(9)
        mujoco.mju_quat2Mat(self._normal, model.geom_quat[ground])
        self._normal = self._normal.reshape(3, 3)[:, 2]
        self._origin = np.array(model.geom_pos[ground])

    def force(self, t: float) -> None:
        model, data = self._sim.model, self._sim.data
        height = (data.geom_xpos[self._geoms] - self._origin) @ self._normal - self._r
        twist = np.zeros(6)
        for i in np.flatnonzero(height <= 0.0):
            # Six numbers in the order of MuJoCo: turning, then moving, both along the axes of W, of the cap's centre.
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, int(self._geoms[i]), twist, 0)
            v = twist[3:] - (twist[3:] @ self._normal) * self._normal
            f = -self._c * v
            body = int(self._body[i])
            data.xfrc_applied[body, :3] += f
            data.xfrc_applied[body, 3:] += np.cross(data.geom_xpos[self._geoms[i]] - data.xipos[body], f)

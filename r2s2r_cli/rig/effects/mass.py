"""Effects of mass: a centre of mass elsewhere, something heavy tied on."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene
from r2s2r_cli.rig.model.options import Options
from r2s2r_cli.rig.section import Index, Positive, Shift3


class ComOffset(EffectSection):
    """The centre of mass of a rod lies elsewhere."""

    rod: Index
    """Its number."""
    by_m: Shift3
    """In the rod's frame R [m]."""

    def options(self, options: Options) -> Options:
        """Masses can be changed."""
        return replace(options, movable_mass=True)

    def law(self, scene: Scene) -> Law:
        """The inertial frame of the MuJoCo body moved, its moments as they are."""
        body = _body(scene, self.rod)
        scene.sim.model.body_ipos[body] += np.array(self.by_m)
        _derive(scene)
        return Law()


class Payload(EffectSection):
    """Something heavy is tied to a rod."""

    rod: Index
    """Its number."""
    mass_kg: Positive = 0.03
    """[kg]"""
    at_m: Shift3 = (0.0, 0.0, 0.0)
    """In the rod's frame R [m]."""

    def options(self, options: Options) -> Options:
        """Masses can be changed."""
        return replace(options, movable_mass=True)

    def law(self, scene: Scene) -> Law:
        """A point mass joined to the MuJoCo body: mass, centre and inertia of the sum."""
        model, body = scene.sim.model, _body(scene, self.rod)
        axes = _matrix(model.body_iquat[body])
        m, p = float(model.body_mass[body]), np.array(model.body_ipos[body])
        about = axes @ np.diag(model.body_inertia[body]) @ axes.T
        total = m + self.mass_kg
        centre = (m * p + self.mass_kg * np.array(self.at_m)) / total
        for mass, d in ((m, p - centre), (self.mass_kg, np.array(self.at_m) - centre)):
            about = about + mass * (d @ d * np.eye(3) - np.outer(d, d))
        moments, turned = np.linalg.eigh(about)
        if np.linalg.det(turned) < 0:
            turned[:, 0] = -turned[:, 0]
        q = np.zeros(4)
        mujoco.mju_mat2Quat(q, turned.ravel())
        model.body_mass[body], model.body_ipos[body] = total, centre
        model.body_inertia[body], model.body_iquat[body] = moments, q
        _derive(scene)
        return Law()


def _body(scene: Scene, rod: int) -> int:
    return int(scene.sim.model.body("rod_" + scene.robot.rods[rod].name).id)


def _derive(scene: Scene) -> None:
    """Let MuJoCo compute anew what it derives from masses; its pose is put back."""
    data = mujoco.MjData(scene.sim.model)
    mujoco.mj_setConst(scene.sim.model, data)


def _matrix(q: np.ndarray) -> np.ndarray:
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, q)
    return flat.reshape(3, 3)

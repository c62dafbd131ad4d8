"""Effects of the contact that are numbers of MuJoCo's geoms: rolling, softness, size of the caps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.model.options import Options
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.section import Positive, Shift, Size


class RollingResistance(EffectSection):
    """Caps do not roll freely, nor turn freely on the spot."""

    rolling_m: Size = 0.001
    """Lever arm of the normal force against rolling [m]."""
    turning_m: Size = 0.001
    """The same against turning about the normal [m]."""

    def law(self, scene: Scene) -> Law:
        """MuJoCo's own rolling and torsional friction: six-dimensional contacts."""
        model = scene.sim.model
        ground = model.geom("ground").id
        model.geom_condim[ground] = 6
        model.geom_friction[ground, 1:] = self.turning_m, self.rolling_m
        return Law()


class SoftGround(EffectSection):
    """The ground gives way: a mat."""

    time_s: Positive = 0.02
    """1 / natural frequency of a contact [s/rad]."""
    depth_m: Positive = 0.005
    """Depth in which it becomes hard [m]."""

    def options(self, options: Options) -> Options:
        """MuJoCo's soft constraint, softer: a spring that hardens with depth."""
        return replace(options, contact_time_s=self.time_s, impedance=(0.3, 0.95, self.depth_m))


class CapRadius(EffectSection):
    """Caps are smaller or larger than `robot.toml` says: worn rubber."""

    by_m: tuple[Shift, ...]
    """One a cap [m]; missing ones are 0."""

    def law(self, scene: Scene) -> Law:
        """Radii of the MuJoCo spheres; at least a tenth of the radius is left."""
        model = scene.sim.model
        for cap, by in zip(
            cap_geoms(scene.sim, scene.robot.n_caps), per(self.by_m, scene.robot.n_caps, 0.0), strict=True
        ):
            size = model.geom_size[cap, 0]
            model.geom_size[cap, 0] = model.geom_rbound[cap] = max(size + by, size / 10)
        return Law()


def cap_geoms(sim: MujocoSim, n_caps: int) -> np.ndarray:
    """Ids of the caps' geoms, in the order of the caps."""
    return np.array([sim.model.geom(f"cap{i}").id for i in range(n_caps)])

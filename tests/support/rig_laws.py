"""What laws of the rig act on in their tests: a scene that they do not touch, a world that has settled quickly."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import Scene
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.world import World
from tests.support.rig_robots import known

DT = 0.001
NONE = np.zeros(6)


def scene() -> Scene:
    """A robot to make laws with that do not touch its model."""
    robot = known()
    return Scene(robot, MujocoSim(robot), np.full(6, 0.0035), np.random.default_rng(0))


SCENE = scene()


def world(**effects: object) -> World:
    """A world with effects, settled quickly."""
    return World.model_validate({"effects": effects, "start": {"settle_s": 0.2}})

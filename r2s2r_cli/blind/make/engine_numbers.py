"""What is constant in a hidden world, as numbers of our engine (tier A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.rig.world import World
from schemas.robot import Robot

if TYPE_CHECKING:
    import torch

    from r2s2r_cli.engine import Parameters

REEL_M_PER_S = 0.5
"""What the engine's winches are told to be able to do: the rig's winches decide."""


def engine_numbers(robot: Robot, hidden: Hidden, world: World) -> Parameters:
    """The engine's numbers of the world: friction, and effects that are constant numbers."""
    import torch

    from r2s2r_cli.stages.model import parameters_of

    theta = parameters_of(robot)
    x = {name: getattr(theta, name).clone() for name in ("mass", "inertia", "p_BE", "p_BS", "cap_radius", "friction",
                                                         "stiffness", "rest", "gravity")}  # fmt: skip
    x["friction"] = torch.full_like(x["friction"], hidden.friction)
    x["speed_in"] = x["speed_out"] = torch.full_like(theta.speed_in, REEL_M_PER_S)
    x["rest_min"], x["rest_max"] = torch.full_like(theta.rest_min, 1e-3), torch.full_like(theta.rest_max, 1.0)
    rods = torch.as_tensor(np.array([cable.caps for cable in robot.cables]) // 2)
    effects = world.effects

    def moved(rod: int, by: torch.Tensor) -> None:
        """The centre of mass of a rod, frame R: points of the body are seen from it."""
        x["p_BE"][0, rod] -= by
        x["p_BS"][0][rods == rod] -= by

    if effects.com_offset is not None:
        moved(effects.com_offset.rod, torch.tensor(effects.com_offset.by_m, dtype=torch.float64))
    if effects.payload is not None:
        p = effects.payload
        m, M = float(x["mass"][0, p.rod]), p.mass_kg
        centre = 0.5 * (theta.p_BE[0, p.rod, 0] + theta.p_BE[0, p.rod, 1])
        at = torch.tensor(p.at_m, dtype=torch.float64) + centre
        by = M / (m + M) * at
        for mass, d in ((m, -by), (M, at - by)):
            x["inertia"][0, p.rod] += mass * (d @ d * torch.eye(3, dtype=torch.float64) - torch.outer(d, d))
        x["mass"][0, p.rod] = m + M
        moved(p.rod, by)
    if effects.cap_friction is not None:
        x["friction"] = x["friction"] * _padded(effects.cap_friction.factors, robot.n_caps, 1.0).reshape(1, -1, 2)
    if effects.cap_radius is not None:
        x["cap_radius"] = x["cap_radius"] + _padded(effects.cap_radius.by_m, robot.n_caps, 0.0).reshape(1, -1, 2)
    if effects.tendon_stiffness is not None:
        x["stiffness"] = x["stiffness"] * _padded(effects.tendon_stiffness.factors, len(robot.cables), 1.0)[None]
    if effects.tendon_set is not None:
        passive = [k for k, cable in enumerate(robot.cables) if cable.kind == "passive"]
        x["rest"] = x["rest"] + _padded(effects.tendon_set.lengths_m, len(robot.cables), 0.0)[None, passive]
    if effects.ground_slope is not None:
        a = world.start.heading_rad
        R = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        down = -np.array(effects.ground_slope.normal())
        # The floor stays level and gravity leans against it: the camera is levelled on the floor.
        g = float(np.linalg.norm(theta.gravity[0].numpy()))
        lean = np.array([-down[0], -down[1], down[2]]) @ R.T
        x["gravity"] = torch.as_tensor(g * lean / np.linalg.norm(lean))[None]
    return theta.with_values(x)


def _padded(values: tuple[float, ...], n: int, fill: float) -> torch.Tensor:
    import torch

    return torch.tensor([*values, *(fill,) * n][:n], dtype=torch.float64)

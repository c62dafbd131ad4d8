"""What a world file makes of a robot before anything moves: does it fit, options of the model, where the robot lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.rig.model.frames import Pose, quaternion, rest_pose, rotation
from r2s2r_cli.rig.model.mjcf_text import ground_rotation
from r2s2r_cli.rig.model.options import STIFF, Options
from r2s2r_cli.rig.world.file import World
from schemas.robot import Robot


def require_parts(robot: Robot, world: World) -> None:
    """Raises UsageError where the world file names a rod, cable, cap, motor or sensor that the robot does not have."""
    counts = {
        "rod": len(robot.rods), "cable": len(robot.cables), "motor": len(robot.motors), "sensor": len(robot.sensors),
    }  # fmt: skip
    tables: list[tuple[str, object]] = [("effects." + name, effect) for name, effect in world.effects.present()]
    tables += [(f"effects.attachment_offset.moved.{i}", one) for i, one in enumerate(_moved(world))]
    tables += [(f"faults.{i}", fault) for i, fault in enumerate(world.faults)]
    for where, table in tables:
        for key, count in counts.items():
            value = getattr(table, key, None)
            if isinstance(value, int) and value >= count:
                raise UsageError(
                    f"the robot has no {key} {value}", where=f"world file: {where}.{key}",
                    expected=f"0 to {count - 1}", received=str(value), hint=f"correct {where}.{key} in the world file",
                )  # fmt: skip


def options_of(world: World) -> Options:
    """Step, ground and contacts of the model: the world's own, and what its effects make of them."""
    options = STIFF if world.stiff else Options(timestep_s=world.timestep_s)
    options = replace(options, friction=world.floor.friction, restitution=world.floor.restitution)
    for _, effect in world.effects.present():
        options = effect.options(options)
    return options


def start_pose(robot: Robot, world: World, options: Options) -> Pose:
    """The rest pose turned by the heading, moved, and laid on the floor."""
    pose = rest_pose(robot)
    a = world.start.heading_rad
    R_GS = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    R_WG = ground_rotation(options.ground_normal)
    # The floor's own x axis is as near the world's as can be, so a level floor turns nothing.
    p_GR = pose.p_WR @ R_GS.T + np.array([*world.start.position_m, 0.0])
    R_WR = R_WG @ R_GS @ rotation(pose.q_WR)
    return Pose(p_GR @ R_WG.T, np.array([quaternion(R) for R in R_WR]), pose.rest)


def _moved(world: World) -> tuple[object, ...]:
    offset = world.effects.attachment_offset
    return () if offset is None else offset.moved

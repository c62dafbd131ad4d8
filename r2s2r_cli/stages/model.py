"""`robot.toml` -> what the engine reads: the structure of the step and its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.masses import mass_properties
from r2s2r_cli.stages.init.attachment import rod_frames, site_points

if TYPE_CHECKING:
    import torch

    from r2s2r_cli.engine import Parameters, State, Structure
    from schemas.robot import Robot

GRAVITY = 9.81
"""[m/s^2], along -z of the world."""
IMPACT_SPEED = 0.05
"""[m/s] below it nothing bounces (contact.md section 2)."""
ROD_FRICTION = 0.3
"""Between rods: nobody has measured it; collisions are rare and short."""
REST_MIN = 0.005
"""[m] a winched cable keeps at least this rest length, however close its caps may come."""


def structure_of(robot: Robot) -> Structure:
    """Topology and laws of a robot: which laws its numbers need."""
    from r2s2r_cli.engine import Structure

    return Structure(
        n_rods=len(robot.rods),
        cable_rods=tuple((cable.caps[0] // 2, cable.caps[1] // 2) for cable in robot.cables),
        actuated=robot.actuated,
        cubic=any(cable.stiffness2_n_per_m2 or cable.stiffness3_n_per_m3 for cable in robot.cables),
        tendons=any(sensor.stiffness_n_per_m > 0 for sensor in robot.sensors),
    )


def parameters_of(robot: Robot) -> Parameters:
    """Numbers of a robot on level ground, float64, batch of 1. Raises InputError for a robot that cannot be."""
    import torch

    from r2s2r_cli.engine import EngineInputError, Parameters, check_parameters

    bodies = [mass_properties(rod.parts) for rod in robot.rods]
    com = np.array([body.com for body in bodies])
    half = np.array([rod.length_m for rod in robot.rods]) / 2
    ends = np.array([cable.caps for cable in robot.cables]).reshape(-1, 2)
    sites = np.array([cable.sites_m for cable in robot.cables]).reshape(-1, 2, 3)
    motors = sorted(robot.motors, key=lambda motor: motor.cable)
    beside = {sensor.cable: sensor for sensor in robot.sensors if sensor.stiffness_n_per_m > 0}
    offset = site_distances(robot) - cap_distances(robot)
    winched = list(robot.actuated)
    speed = [motor.no_load_rad_per_s * motor.speed * motor.winch_radius_m for motor in motors]

    def row(values: object) -> torch.Tensor:
        return torch.as_tensor(np.array(values, dtype=float))[None]

    tall = np.zeros((len(bodies), 2, 3))
    tall[:, 0, 2], tall[:, 1, 2] = -half - com, half - com
    theta = Parameters(
        mass=row([body.mass for body in bodies]),
        inertia=row([np.diag([body.inertia_transverse] * 2 + [body.inertia_axial]) for body in bodies]),
        p_BE=row(tall),
        cap_radius=row([[rod.cap_radius_m] * 2 for rod in robot.rods]),
        rod_radius=row([rod.radius_m for rod in robot.rods]),
        friction=row([[robot.contact.friction] * 2 for _ in robot.rods]),
        restitution=row([robot.contact.restitution]),
        impact_speed=row([IMPACT_SPEED]),
        rod_friction=row([ROD_FRICTION]),
        p_BS=row(sites - np.array([0.0, 0.0, 1.0]) * com[ends // 2][..., None]),
        stiffness=row([cable.stiffness_n_per_m for cable in robot.cables]),
        stiffness2=row([cable.stiffness2_n_per_m2 for cable in robot.cables]),
        stiffness3=row([cable.stiffness3_n_per_m3 for cable in robot.cables]),
        damping=row([cable.damping_n_s_per_m for cable in robot.cables]),
        rest=row([cable.rest_length_m for cable in robot.cables if cable.kind == "passive"]),
        tendon_stiffness=row([beside[k].stiffness_n_per_m if k in beside else 0.0 for k in range(len(robot.cables))]),
        tendon_rest=row([beside[k].rest_length_m if k in beside else 0.0 for k in range(len(robot.cables))]),
        speed_in=row(speed),
        speed_out=row(speed),
        rest_min=row(np.maximum(robot.limits.cable_length_min_m + offset[winched], REST_MIN)),
        rest_max=row(robot.limits.cable_length_max_m + offset[winched]),
        lag=row(np.zeros(len(winched))),
        droop=row(np.zeros(len(winched))),
        gravity=row([0.0, 0.0, -GRAVITY]),
    )
    try:
        check_parameters(structure_of(robot), theta)
    except EngineInputError as error:
        raise InputError(
            f"the engine cannot simulate this robot: {error.what}", where=f"robot.toml: {error.field}",
            expected=error.expected, received=error.received, hint="r2s2r validate robot.toml",
        ) from error  # fmt: skip
    return theta


def cap_distances(robot: Robot, p_WE: np.ndarray | None = None) -> np.ndarray:
    """Distance of the two caps of every cable [m], (cable,). p_WE: end caps [m], (cap, 3); None: the rest pose."""
    p_WE = np.array(robot.rest_caps_m) if p_WE is None else p_WE
    ends = np.array([cable.caps for cable in robot.cables]).reshape(-1, 2)
    return np.asarray(np.linalg.norm(p_WE[ends[:, 1]] - p_WE[ends[:, 0]], axis=-1))


def site_distances(robot: Robot) -> np.ndarray:
    """Distance of the two attachment points of every cable in the rest pose [m], (cable,)."""
    p_WE = np.array(robot.rest_caps_m)
    sites = np.array([cable.sites_m for cable in robot.cables]).reshape(-1, 2, 3)
    p_WS = site_points(p_WE, [cable.caps for cable in robot.cables], sites, rod_frames(p_WE))
    return np.asarray(np.linalg.norm(p_WS[:, 1] - p_WS[:, 0], axis=-1))


def rest_state(robot: Robot) -> State:
    """The rest pose of `robot.toml` as it stands there, at rest; cables taut by nothing yet. Batch of 1."""
    import torch

    from r2s2r_cli.engine import pose_state

    p_WE = np.array(robot.rest_caps_m)
    theta, structure = parameters_of(robot), structure_of(robot)
    lengths = site_distances(robot)[list(robot.actuated)]
    return pose_state(
        structure, theta, torch.as_tensor(p_WE)[None], torch.as_tensor(rod_frames(p_WE))[None],
        rest=torch.as_tensor(lengths)[None],
    )  # fmt: skip

"""One experiment for each effect of the rig: what is measured without it and with it, and what it says of itself.

`rig_effects_picture.py` draws them; `tests/rig/test_effects_shown.py` runs them and asks whether it is true.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

Drive = Callable[[float], np.ndarray]
See = Callable[[Plant], float]
STEP = 0.02
ROBOT = Robot.model_validate(tomllib.loads(robot_toml("threebar", "surface")))


def _flat() -> Robot:
    """Two of its rods side by side on the floor, along x, with a slack cord between them and no motor."""
    facts = tomllib.loads(robot_toml("threebar", "surface"))
    facts["rods"] = facts["rods"][:2]
    half, r = facts["rods"][0]["length_m"] / 2, facts["rods"][0]["cap_radius_m"]
    facts["rest_caps_m"] = [[side * half, y, r] for y in (-0.1, 0.1) for side in (-1.0, 1.0)]
    cord = {"caps": [0, 2], "kind": "passive", "rest_length_m": 1.0, "sites_m": [[0.0, 0.0, -half]] * 2}
    facts["cables"] = [{**cord, "stiffness_n_per_m": 100.0, "damping_n_s_per_m": 0.0}]
    facts["motors"], facts["sensors"], facts["colors"] = [], [], []
    return Robot.model_validate(facts)


FLAT = _flat()


@dataclass(frozen=True)
class Experiment:
    """One effect with its table of the world file; what it `says` of itself, and what then is `true` of (t, without,
    with); what is seen; what is driven, for how long [s], from which start."""

    id: str
    table: Mapping[str, Any]
    says: str
    unit: str
    see: See
    true: Callable[[np.ndarray, np.ndarray, np.ndarray], bool]
    drive: Drive
    seconds: float = 2.0
    start: Callable[[Plant], None] | None = None
    robot: Robot = ROBOT
    against: See | None = None
    """What stands on the other axis; None: time [s]."""
    against_unit: str = "t [s]"


@dataclass(frozen=True)
class Sight:
    """One effect of the camera with its table, what it `says` of itself, and which picture, taken when [s], shows."""

    id: str
    table: Mapping[str, Any]
    says: str
    what: Literal["color", "depth"] = "color"
    at_s: float = 0.0


def trace(one: Experiment, *, on: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], what is seen, and what stands on the other axis, without or with the effect."""
    plant = Plant(one.robot, World.model_validate({"effects": {one.id: dict(one.table)} if on else {}}))
    if one.start is not None:
        one.start(plant)
    t, y, x = [], [], []
    for k in range(round(one.seconds / STEP)):
        plant.advance(STEP, one.drive(k * STEP)[: len(one.robot.motors)])
        t.append(plant.t)
        y.append(one.see(plant))
        x.append(one.against(plant) if one.against else plant.t)
    return np.array(t), np.array(y), np.array(x)


def pull(*motors: int, duty: float = 0.8, until: float = 1.2, back: float = 0.0) -> Drive:
    """Reel in `motors` until a time [s], then let out with `back` times the duty."""

    def drive(t: float) -> np.ndarray:
        u = np.zeros(6)
        u[list(motors)] = duty if t < until else -back * duty
        return u

    return drive


def ramp(t: float) -> np.ndarray:
    """Duty of motor 0 up to 0.4 and down again within 2 s."""
    return np.array([0.4 * (1.0 - abs(t - 1.0)), 0.0, 0.0, 0.0, 0.0, 0.0])


def to_and_fro(t: float) -> np.ndarray:
    """Motors 0 and 3 in and out, every 0.5 s."""
    u = np.zeros(6)
    u[[0, 3]] = 0.8 if int(t / 0.5) % 2 == 0 else -0.8
    return u


def still(t: float) -> np.ndarray:
    """No motor turns."""
    return np.zeros(6)


def shove(plant: Plant) -> None:
    """The whole robot is pushed to 0.8 m/s along x."""
    plant.sim.data.qvel[0::6] = 0.8


def lifted(plant: Plant) -> None:
    """The whole robot is held 1 m above the floor and let go."""
    plant.sim.data.qpos[2::7] += 1.0


def rolling(plant: Plant) -> None:
    """Rods along x roll towards y at 0.4 m/s."""
    r = plant.robot.rods[0].cap_radius_m
    for i in range(len(plant.robot.rods)):
        plant.sim.data.qvel[6 * i + 1] = 0.4
        plant.sim.data.qvel[6 * i + 5] = -0.4 / r


def pressure_x(plant: Plant) -> float:
    """Where the forces of the ground act together, x [mm]."""
    truth = plant.truth()
    up = truth.force[:, 2]
    return float(up @ truth.p_WE[:, 0] / up.sum() * 1e3)


def speed(plant: Plant) -> float:
    """Of shaft 0 [rad/s]."""
    return float(plant.winches.w[0])


def middle(axis: int) -> See:
    """The middle of all caps along an axis [mm]."""
    return lambda plant: float(plant.truth().p_WE[:, axis].mean() * 1e3)


def cap(i: int, axis: int) -> See:
    """A cap along an axis [mm]."""
    return lambda plant: float(plant.truth().p_WE[i, axis] * 1e3)


def length(k: int) -> See:
    """Of a cable, between caps [mm]."""
    return lambda plant: float(plant.lengths()[k] * 1e3)


def wound(k: int) -> See:
    """Cable on a winch since the rest pose [mm]."""
    start = float(Plant(ROBOT, World.model_validate({"start": {"settle_s": 0.0}})).winches.rest[k])
    return lambda plant: (start - float(plant.winches.acting[k])) * 1e3


def tension(k: int) -> See:
    """Of a cable [N]."""
    return lambda plant: float(plant.truth().tension[k])


def pressed(plant: Plant) -> float:
    """Force of the ground on all caps, upwards [N]."""
    return float(plant.truth().force[:, 2].sum())


def shown(k: int) -> See:
    """What the sensor of a cable is stretched to [mm]."""
    return lambda plant: float(plant.sensed()[k] * 1e3)


def held_back(plant: Plant) -> float:
    """How much longer cable 0 acts than its winch has set it [mm]."""
    return float((plant.winches.acting - plant.winches.rest)[0] * 1e3)


def stamp(plant: Plant) -> float:
    """What the camera writes on a frame taken now, from its start [s]."""
    return plant.t + plant.world.seen().clock.stamp_delay_s


EXPERIMENTS: tuple[Experiment, ...] = (
    Experiment("motor_dead_zone", {"start": 0.2, "keep": 0.1}, "starts late, and stops later still on the way down",
               "shaft speed [rad/s]", speed,
               lambda t, off, on: (on[t < 0.48] == 0).all() and on[(t > 1.6) & (t < 1.7)].min() > 0 == on[-1], ramp),
    Experiment("command_latency", {"delay_s": 0.2}, "the same, 0.2 s later", "cable on the winch [mm]", wound(0),
               lambda t, off, on: np.abs(on[10:] - off[:-10]).max() < 0.1, pull(0)),
    Experiment("motor_lag", {"start_s": 0.2, "stop_s": 0.1}, "rounded start, run-on after the stop",
               "shaft speed [rad/s]", speed,
               lambda t, off, on: on[2] < off[2] / 2 and on[62] > 1 and off[62] == 0, pull(0)),
    Experiment("motor_speed_mismatch", {"factors": [0.7]}, "one winch is slow, always", "cable on the winch [mm]",
               wound(0), lambda t, off, on: abs(on[50] / off[50] - 0.7) < 0.01, pull(0, 2)),
    Experiment("battery_sag", {"motor_s": 30.0, "fall": 0.4, "per_motor": 0.02},
               "slower with every second that motors run, and the more of them run", "shaft speed, size [rad/s]",
               lambda plant: abs(speed(plant)),
               lambda t, off, on: on[-1] < 0.75 * off[-1] and on[1] < off[1], to_and_fro, 24.0),
    Experiment("load_droop", {"stall_n": 25.0}, "slow where the cable is tense", "shaft speed [rad/s]", speed,
               lambda t, off, on: on[5] > on[60] and on[60] < 0.9 * off[60], pull(0, 1, 2, until=1.4)),
    Experiment("spool_buildup", {"layer_m": 0.0006, "wraps": 1.5}, "faster layer by layer", "cable on the winch [mm]",
               wound(0), lambda t, off, on: np.diff(on)[58] > 1.15 * np.diff(off)[58] and abs(on[10] - off[10]) < 0.1,
               pull(0)),
    Experiment("backlash", {"play_m": 0.008}, "every reversal loses the play", "cable that acts [mm]", wound(0),
               lambda t, off, on: on[23] < off[23] - 6 and np.ptp(on) < np.ptp(off) - 6, to_and_fro, 3.0),
    Experiment("tendon_stiffness", {"factors": [1, 1, 1, 1, 1, 1, 0.5]}, "the softened cable is longer",
               "length of cable 6 [mm]", length(6), lambda t, off, on: (on - off)[-1] > 5, pull(3)),
    Experiment("tendon_relaxation", {"fast_share": 0.1, "slow_share": 0.3, "fast_s": 1.0, "slow_s": 8.0},
               "tension falls while nothing moves", "tension of cable 6 [N]", tension(6),
               lambda t, off, on: on[-1] < on[100] - 0.3 and abs(off[-1] - off[100]) < 0.2, pull(0, 3), 12.0),
    Experiment("tendon_hysteresis", {"force_n": 1.0}, "pulls harder while it lengthens", "tension of cable 6 [N]",
               tension(6), lambda t, off, on: np.abs(on - off).max() > 0.3, to_and_fro, 3.0, against=length(6),
               against_unit="length of cable 6 [mm]"),
    Experiment("tendon_set", {"lengths_m": [0, 0, 0, 0, 0, 0, 0.02, 0.02, 0.02], "slip_n": 9.0},
               "at 9 N a knot gives way, and the cable stays longer", "tension of cable 6 [N]", tension(6),
               lambda t, off, on: abs(on[2] - off[2]) < 1e-9 and on[-1] < off[-1] - 0.3, pull(0, 3)),
    Experiment("capstan_friction", {"wrap": 0.4}, "less pull arrives while it reels in, more while it lets out",
               "cable held back at the winch [mm]", held_back,
               lambda t, off, on: on[2:24].min() > 0.3 and on[30:49].max() < -0.3 and not off.any(), to_and_fro),
    Experiment("attachment_offset", {"moved": [{"cable": 6, "end": 0, "by_m": [0.0, 0.0, 0.04]}]},
               "a cable that is tied elsewhere holds another shape", "height of cap 3 [mm]", cap(3, 2),
               lambda t, off, on: abs(on - off)[0] > 1, still, 1.0),
    Experiment("com_offset", {"rod": 0, "by_m": [0.0, 0.0, 0.05]}, "the floor's force moves towards the heavy end",
               "where the floor pushes, x [mm]", pressure_x, lambda t, off, on: 8 < (on - off).mean() < 14, still, 1.0),
    Experiment("payload", {"rod": 1, "mass_kg": 0.08}, "the floor carries 0.78 N more", "force of the floor [N]",
               pressed, lambda t, off, on: abs((on - off)[-1] - 0.08 * 9.81) < 0.05, still, 1.0),
    Experiment("friction_field", {"patches": [{"center_m": [0.25, 0.0], "radius_m": 0.15, "factor": 0.1}]},
               "slides on where the floor is slippery", "middle of the robot, x [mm]", middle(0),
               lambda t, off, on: on[-1] > off[-1] + 3, still, 1.0, shove),
    Experiment("friction_anisotropy", {"angle_rad": 0.0, "across": 0.4, "against": 0.3},
               "slides farther along the pile, with the nap", "middle of the robot, x [mm]", middle(0),
               lambda t, off, on: on[-1] > off[-1] + 20, still, 1.0, shove),
    Experiment("stribeck", {"static_factor": 2.0, "speed_m_per_s": 0.3}, "grips more the slower it slides",
               "middle of the robot, x [mm]", middle(0), lambda t, off, on: on[-1] < off[-1] - 1, still, 1.0, shove),
    Experiment("viscous_contact", {"drag_n_s_per_m": 2.0}, "a fast slip is shorter", "middle of the robot, x [mm]",
               middle(0), lambda t, off, on: on[-1] < off[-1] - 1, still, 1.0, shove),
    Experiment("rolling_resistance", {"rolling_m": 0.001, "turning_m": 0.001}, "rods that roll come to rest",
               "middle of two rods, y [mm]", middle(1),
               lambda t, off, on: np.diff(on)[-1] < 0.05 < 5 < np.diff(off)[-1], still, 2.0, rolling, robot=FLAT),
    Experiment("soft_ground", {"time_s": 0.03, "depth_m": 0.01}, "caps sink in", "height of the lowest cap [mm]",
               lambda plant: float(plant.truth().p_WE[:, 2].min() * 1e3), lambda t, off, on: on[0] < off[0] - 0.3,
               to_and_fro),
    Experiment("cap_friction", {"factors": [0.1, 1.0, 0.1, 1.0, 1.0, 0.1]}, "dirty caps slide on",
               "middle of the robot, x [mm]", middle(0), lambda t, off, on: on[-1] > off[-1] + 10, still, 1.0, shove),
    Experiment("cap_radius", {"by_m": [-0.003]}, "the worn cap lies lower", "height of cap 0 [mm]", cap(0, 2),
               lambda t, off, on: abs((on - off)[0] + 3) < 0.2, pull(3)),
    Experiment("ground_slope", {"angle_y_rad": 0.05}, "drifts downhill", "middle of the robot, x [mm]", middle(0),
               lambda t, off, on: (on - on[0])[-1] > (off - off[0])[-1] + 1, to_and_fro, 6.0),
    Experiment("obstacle", {"from_m": [0.17, -0.5], "to_m": [0.17, 0.5]},
               "a cap that slides against the ridge is held up", "cap 5, x [mm]", cap(5, 0),
               lambda t, off, on: off[-1] > 170 > 160 > on[-1], still, 1.0, shove),
    Experiment("tether_drag", {"anchor_m": [0.0, -2.0, 0.3], "stiffness_n_per_m": 1.0, "largest_n": 0.5},
               "pulled towards the anchor", "middle of the robot, y [mm]", middle(1),
               lambda t, off, on: (on - on[0])[-1] < (off - off[0])[-1] - 1, to_and_fro, 6.0),
    Experiment("air_drag", {"density_kg_per_m3": 60.0}, "falls more slowly (in something much thicker than air)",
               "middle of the robot, z [mm]", middle(2), lambda t, off, on: on[20] > off[20] + 5, still, 0.44, lifted),
    Experiment("sensor_bias", {"lengths_m": [0.015], "settles_s": 0.5}, "off by a length, once it is warm",
               "shown length of cable 0 [mm]", shown(0), lambda t, off, on: abs((on - off)[-1] - 15) < 0.5, pull(0, 3)),
    Experiment("sensor_gain", {"factors": [1.2], "about_m": 0.2}, "off in proportion to the change of length",
               "shown length of cable 0 [mm]", shown(0),
               lambda t, off, on: np.allclose(on, 200 + 1.2 * (off - 200)), pull(0, 3)),
    Experiment("sensor_saturation", {"above_m": 0.16, "rest_m": 0.005}, "flat beyond a length",
               "shown length of cable 0 [mm]", shown(0), lambda t, off, on: on.max() < 166 and on[-1] == off[-1],
               pull(0, 3)),
    Experiment("camera_delay", {"delay_s": 0.15}, "what is seen has happened earlier than the stamp says",
               "height of cap 1 [mm]", cap(1, 2), lambda t, off, on: bool(np.array_equal(on, off)), to_and_fro,
               against=stamp, against_unit="stamp of the frame [s]"),
)  # fmt: skip
"""All that show in a curve."""

CAMERA = (
    Sight("camera_pose", {"turn_rad": [0.0, 0.06, 0.15], "by_m": [0.1, 0.0, 0.0]}, "knocked askew"),
    Sight(
        "camera_scale", {"depth_error": 0.08, "focal_error": 0.08}, "larger in the picture, and farther away", "depth"
    ),
    Sight("dropout", {"frames": 0.3, "pixels": 0.3}, "holes in depth, and a third of the frames missing", "depth"),
)
"""Effects that show in a single picture of the robot at rest."""

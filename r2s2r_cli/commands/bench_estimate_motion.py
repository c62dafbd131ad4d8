"""What the rig's robot does in a case of `bench estimate`: the plant under its boards and our controller, no camera.

Time is the rig's, nothing waits: samples reach the controller as they are taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from r2s2r_cli.artifact import Group
    from r2s2r_cli.devices.lengths import Lengths
    from r2s2r_cli.rig.world import World
    from schemas.robot import Robot

LOOK_S = 0.005
"""Between two instants of the truth: at the accelerations of this robot a straight line in between is 0.03 mm off."""
REST_S = 1.5
"""The robot rests so long before its first target."""
SLOPE_F_PER_M, OFFSET_F = 3e-11, 1.4e-11
"""Of every sensor in the robot.toml that rig and tracker share."""
HOLD_S = 0.3
"""Between the arrival of all cables and the next target."""


@dataclass(frozen=True)
class Motion:
    """A run of the rig.

    t: instants of the truth [s], (n,), every LOOK_S. p_WE: end caps [m], (n, cap, 3). length: of the cables [m],
    (n, cable). force: of the ground on the caps along its normal [N], (n, cap). weight: of the robot [N]. streams: what
    the host recorded (`schemas/recording.py`), without pictures. driven: some motor runs, bool (n,).
    """

    t: np.ndarray
    p_WE: np.ndarray
    length: np.ndarray
    force: np.ndarray
    weight: float
    streams: dict[str, Group]
    driven: np.ndarray


def robot_of(name: str = "threebar") -> Robot:
    """A known robot with calibrated sensors."""
    import tomllib

    from r2s2r_cli.stages.init.robots import robot_toml
    from schemas.robot import Robot

    values = tomllib.loads(robot_toml(name))
    for sensor in values["sensors"]:
        sensor["slope_f_per_m"], sensor["offset_f"] = SLOPE_F_PER_M, OFFSET_F
    return Robot.model_validate(values)


def moved(robot: Robot, world: World, seed: int, run_s: float) -> Motion:
    """The run of one seed: random binary target shapes, one after the other as its cables arrive."""
    from r2s2r_cli.devices.lengths import Lengths
    from r2s2r_cli.devices.pid import WirePid, WireSteps, ticks
    from r2s2r_cli.rig.firmware import Firmware
    from r2s2r_cli.rig.plant import Plant

    plant = Plant(robot, world)
    firmware = Firmware(robot, world, plant)
    period = 1.0 / robot.pid.rate_hz
    n, winched = len(robot.actuated), list(robot.actuated)
    duty_of = [(motor, winched.index(m.cable), m.sign) for motor, m in enumerate(robot.motors)]
    steps = np.random.default_rng([seed, 1]).integers(0, 2, (int(run_s) + 1, n)).astype(float)
    targets = np.concatenate([np.ones((1, n)), steps])
    holds = np.array([REST_S, *np.full(len(steps), HOLD_S)])
    clock = WireSteps(ticks(holds, period), ticks(np.full(len(targets), robot.pid.step_timeout_s + REST_S), period))
    pid, lengths = WirePid.of(robot), Lengths.of(robot)
    latest = np.full(len(robot.sensors), np.nan)
    log: dict[str, list[np.ndarray]] = {name: [] for name in ("t", "p", "length", "force", "driven")}
    sensors: list[tuple[float, float, int, np.ndarray]] = []
    commands: list[tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    for k in range(round(run_s / LOOK_S) + 1):
        for sample in firmware.tick(k * LOOK_S):
            heard = 1e-12 * sample.pF
            latest = np.where(np.isfinite(heard), heard, latest)
            sensors.append((sample.t, sample.t_board, sample.board, heard))
        if k % round(period / LOOK_S) == 0 and not clock.finished:
            length, target = lengths(latest), targets[clock.index]
            control = pid.tick(length[winched], target)
            firmware.command(np.array([control[at] * sign for _, at, sign in duty_of]), plant.t)
            commands.append((k * LOOK_S, target, control, pid.done.copy(), pid.position(length[winched])))
            if clock.advance(pid.done)[0]:
                pid.restart()
        truth = plant.truth()
        values = (np.array(k * LOOK_S), truth.p_WE, truth.length, truth.force[:, 2], np.any(firmware.duty != 0))
        for name, value in zip(log, values, strict=True):
            log[name].append(np.asarray(value))
    arrays = {name: np.array(values) for name, values in log.items()}
    weight = float(plant.sim.model.body_mass.sum() * 9.81)
    return Motion(t=arrays["t"], p_WE=arrays["p"], length=arrays["length"], force=arrays["force"], weight=weight,
                  streams=_streams(robot, sensors, commands, lengths), driven=arrays["driven"])  # fmt: skip


def _streams(
    robot: Robot,
    sensors: list[tuple[float, float, int, np.ndarray]],
    commands: list[tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    lengths: Lengths,
) -> dict[str, Group]:
    from r2s2r_cli.artifact import Group

    t, t_board, board, heard = (np.array(column) for column in zip(*sensors, strict=True))
    at, target, control, done, position = (np.array(column) for column in zip(*commands, strict=True))
    facts = {"origin": "rig", "nature": "simulated", "source": "r2s2r bench estimate", "robot": robot.name,
             "clock": "host"}  # fmt: skip
    return {
        "": Group({}, facts),
        "sensors": Group({"t": t, "t_board": t_board, "board": board.astype(np.int64), "capacitance": heard,
                          "length": lengths(heard)[:, lengths.cable], "cable": lengths.cable}),
        "commands": Group({"t": at, "target": target, "control": control, "done": done}),
        "motors": Group({"t": at, "position": position, "speed": control}),
    }  # fmt: skip

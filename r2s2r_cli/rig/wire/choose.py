"""A device codec by its name, for a robot that can speak it."""

from __future__ import annotations

from collections.abc import Callable

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.rig.wire.base import DeviceCodec, Motors
from r2s2r_cli.rig.wire.boards import BoardsCodec
from r2s2r_cli.rig.wire.checked import CheckedCodec
from r2s2r_cli.rig.wire.legacy import LegacyCodec
from schemas.robot import Robot

PROTOCOLS = ("checked", "boards", "legacy")
"""Names of the protocols."""

_MOTORS, _SENSORS = 6, 9


def device_codec(
    name: str, robot: Robot, motors: Motors, *, boards: int, tick_us: int = 0,
    board_clock: Callable[[float], float] = float,
) -> DeviceCodec:  # fmt: skip
    """The device side of protocol `name`. boards: how many the robot has; tick_us: lock-step, else 0.

    Raises UsageError for an unknown name, InputError where the authors' protocols have no place for this robot.
    """
    if name not in PROTOCOLS:
        raise UsageError("no such protocol", where="--protocol", expected=", ".join(PROTOCOLS), received=name,
                         hint="r2s2r rig --protocol checked")  # fmt: skip
    if name == "checked":
        return CheckedCodec(
            motors, robot=robot.name, boards=boards, n_motors=len(robot.motors), n_sensors=len(robot.sensors),
            tick_us=tick_us, board_clock=board_clock,
        )  # fmt: skip
    if (len(robot.motors), len(robot.sensors)) != (_MOTORS, _SENSORS):
        raise InputError(
            f"the authors' protocol {name} has no place for this robot", where=f"robot.toml: {robot.name}",
            expected=f"{_MOTORS} motors and {_SENSORS} sensors",
            received=f"{len(robot.motors)} motors and {len(robot.sensors)} sensors",
            hint="r2s2r rig --protocol checked",
        )  # fmt: skip
    if name == "boards":
        return BoardsCodec(motors)
    return LegacyCodec(motors, sensors=_SENSORS)

"""A whole rig: robot, world, boards, protocol, link, clock and camera put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from r2s2r_cli.rig.camera.service import CameraService
from r2s2r_cli.rig.camera_process import CameraProcess
from r2s2r_cli.rig.clock import RealClock, TickClock
from r2s2r_cli.rig.closing import Closing
from r2s2r_cli.rig.firmware import Firmware
from r2s2r_cli.rig.plant import Plant, Truth
from r2s2r_cli.rig.server import Server
from r2s2r_cli.rig.transport import open_transport
from r2s2r_cli.rig.transport.port import Port
from r2s2r_cli.rig.truth import TruthLog
from r2s2r_cli.rig.wire import device_codec
from r2s2r_cli.rig.world import World
from schemas.robot import Robot

_LOCALHOST = "127.0.0.1"


@dataclass(frozen=True)
class Outlet:
    """How the rig is reached.

    link, protocol: names of transport.LINKS and wire.PROTOCOLS. host, port: where TCP listens and UDP sends to; None:
    the default of the link. shared: one UDP socket for all boards. device: a name for the pty. lock: time in ticks that
    the host asks for, of `1 / pid.rate_hz`. camera_port: of the camera's service, 0: any free one, None: no camera.
    truth: file for the log of what really happens.
    """

    link: str = "pty"
    protocol: str = "checked"
    host: str = _LOCALHOST
    port: int | None = None
    shared: bool = False
    device: Path | None = None
    lock: bool = False
    camera_port: int | None = None
    truth: Path | None = None


class Rig(Closing):
    """A robot on the desk. Opens its ports at once; `serve` lets time begin.

    Raises UsageError and InputError for a robot, world or protocol that do not go together, HardwareError where a port
    cannot be had, OSError where the log of the truth cannot be written.
    """

    def __init__(self, robot: Robot, world: World, outlet: Outlet) -> None:
        world = _with_layout(world, outlet.protocol)
        self._plant = Plant(robot, world)
        self._firmware = firmware = Firmware(robot, world, self._plant)
        tick = 1.0 / robot.pid.rate_hz
        self._clock = TickClock(tick) if outlet.lock else None
        codec = device_codec(
            outlet.protocol, robot, firmware, boards=firmware.boards,
            tick_us=self._clock.us if self._clock else 0, board_clock=lambda t: firmware.clock(0, t),
        )  # fmt: skip
        self._codec, self._world = codec, world
        self.boards = firmware.boards
        """How many boards it has."""
        self._camera: CameraService | CameraProcess | None = None
        self._truth: TruthLog | None = None
        self._transport = open_transport(
            outlet.link, host=outlet.host, port=outlet.port, boards=firmware.boards, shared=outlet.shared,
            name=outlet.device,
        )  # fmt: skip
        try:
            if outlet.truth is not None:
                self._truth = TruthLog(outlet.truth, caps=robot.n_caps, cables=len(robot.cables),
                                       motors=len(robot.motors), period=tick)  # fmt: skip
            if outlet.camera_port is not None:
                # Over UDP `host` is somebody else, to whom the boards send.
                at = outlet.host if outlet.link == "tcp" else _LOCALHOST
                self._camera = (
                    CameraService(robot, world.seen(), seed=world.seed, host=at, port=outlet.camera_port, lossless=True)
                    if outlet.lock
                    else CameraProcess(robot, world.seen(), seed=world.seed, host=at, port=outlet.camera_port)
                )
        except BaseException:
            self.close()
            raise
        self._port = Port(self._transport, codec, world, lock=outlet.lock)
        self._look_due, self._look_period = 0.0, tick / 2
        self.latest_s = 0.0
        """The longest that the loop was behind the wall's clock [s]; known after `serve`."""

    @property
    def address(self) -> str:
        """What a host is given to connect to."""
        return self._transport.address

    @property
    def camera_address(self) -> str | None:
        """The same for the camera."""
        return None if self._camera is None else "rig://{}:{}".format(*self._camera.address)

    def serve(self, stopping: Callable[[], bool]) -> None:
        """Serve until `stopping`; time starts now. Raises NumericalError where the simulation breaks down."""
        clock = self._clock or RealClock()
        server = Server(self._firmware, self._codec, self._port, self._world, clock=clock, observe=self._observe)
        try:
            server.run(stopping)
        finally:
            self.latest_s = server.latest_s

    @property
    def duty(self) -> np.ndarray:
        """Duty of every motor as on the wire, (motor,). May be asked while the rig is served, from another thread."""
        return self._firmware.duty

    def truth(self) -> tuple[Truth, np.ndarray]:
        """What is, and the duty of every motor as on the wire, (motor,): between steps of the simulation."""
        return self._plant.truth(), self.duty

    def close(self) -> None:
        """Release the ports, end the log."""
        self._transport.close()
        if self._camera is not None:
            self._camera.close()
        if self._truth is not None:
            self._truth.close()

    def _observe(self, t: float) -> None:
        if self._camera is not None and t >= self._look_due:
            self._look_due = max(self._look_due + self._look_period, t)
            self._camera.observe(t, self._plant.truth().p_WE)
        if self._truth is not None:
            self._truth.observe(t, self.truth)


def _with_layout(world: World, protocol: str) -> World:
    """The boards as the authors' protocols have them; ours takes what the world file says."""
    layouts: dict[str, Literal["per_rod", "central"]] = {"boards": "per_rod", "legacy": "central"}
    if protocol not in layouts:
        return world
    return world.model_copy(update={"boards": world.boards.model_copy(update={"layout": layouts[protocol]})})

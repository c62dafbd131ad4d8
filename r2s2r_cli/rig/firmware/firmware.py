"""All boards of the robot at work on the plant: duties in, samples out."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.rig.firmware.board import Board
from r2s2r_cli.rig.firmware.generators import generator
from r2s2r_cli.rig.firmware.inertial import InertialUnit
from r2s2r_cli.rig.firmware.layout import posts
from r2s2r_cli.rig.firmware.sample import BoardSample
from r2s2r_cli.rig.firmware.sensors import StretchSensors
from r2s2r_cli.rig.model.frames import xyzw
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world.file import World
from schemas.robot import Robot

_ROUNDING = 1e-9
"""A duty that is a whole step but for rounding is that step."""
_TURN = 2.0 * np.pi


class Firmware:
    """The boards. Their time is the plant's; `tick` moves both on. Deterministic from the world's seed.

    A motor keeps its duty until it gets another: the authors' boards have no watchdog, and the one of our protocol is
    part of the protocol. Raises UsageError for a fault of a board that is not there.
    """

    def __init__(self, robot: Robot, world: World, plant: Plant) -> None:
        _check(world, len(posts(robot, world.boards.layout)))
        self._plant, self._settings = plant, world.boards
        self._motors, self._sensors = len(robot.motors), len(robot.sensors)
        self._sign = np.array([motor.sign for motor in robot.motors], dtype=float)
        self._boards = [
            Board(i, post, world, generator(world, f"board {i}"))
            for i, post in enumerate(posts(robot, world.boards.layout))
        ]
        self._units = [InertialUnit(world.inertial, generator(world, f"imu {i}")) for i in range(len(self._boards))]
        self._stretch = StretchSensors(robot, world, generator(world, "sensors"))
        self._stretch.follow(plant.t, plant.sensed())
        self._duty, self._moved = np.zeros(self._motors), False
        self._later: list[tuple[float, np.ndarray]] = []

    @property
    def boards(self) -> int:
        """How many there are."""
        return len(self._boards)

    @property
    def t(self) -> float:
        """The rig's time [s]."""
        return self._plant.t

    @property
    def duty(self) -> np.ndarray:
        """What the drivers have now, with the sign of the wire, (motor,)."""
        return self._duty.copy()

    def clock(self, board: int, t: float) -> float:
        """What a board's clock shows at the rig's time t [s]."""
        return self._boards[board].clock(t)

    def command(self, duty: np.ndarray, t: float) -> None:
        """Set the PWM at the rig's time t [s]: at once, or, where t is still to come, in the `tick` that gets there.

        duty: -1 .. 1 with the sign of the wire, cut to that and to whole steps, (motor,); NaN: as it was. A board that
        is down does not hear it.
        """
        if t > self._plant.t:
            self._later.append((t, np.array(duty, dtype=float)))
        else:
            self._set(np.asarray(duty, dtype=float))

    def stop(self) -> None:
        """All PWM to 0, now; commands that are still to come are forgotten. A robot that has moved is put back
        where the world file has a hand for it."""
        self._later.clear()
        self._duty = np.zeros(self._motors)
        if self._moved:
            self._plant.put_back()
            self._moved = False

    def tick(self, t: float) -> list[BoardSample]:
        """Go on to the rig's time t [s]; what the boards sampled on the way, in order of time.

        Raises NumericalError as the plant does.
        """
        samples: list[BoardSample] = []
        while True:
            board = min(self._boards, key=lambda b: b.due)
            due = min([board.due, *(when for when, _ in self._later)])
            end = min(due, t)
            # All of them before the first is gone to: by then two of one time would lie behind.
            restarts = [(at, b.post.motors) for b in self._boards for at in b.restarts(self._plant.t, end)]
            for at, motors in sorted(restarts):
                self._go(at)
                self._duty[list(motors)] = 0.0
            self._go(end)
            if due > t:
                return samples
            for when, duty in sorted((one for one in self._later if one[0] <= end), key=lambda one: one[0]):
                del when
                self._set(duty)
            self._later = [one for one in self._later if one[0] > end]
            if board.due <= end:
                if not board.silent(end):
                    samples.append(self._sample(board, end))
                board.sampled()

    def _set(self, duty: np.ndarray) -> None:
        steps = self._settings.pwm_steps
        cut = np.clip(duty, -1.0, 1.0) * steps
        whole = np.trunc(cut + np.sign(cut) * _ROUNDING) / steps
        down = [motor for board in self._boards if board.down(self._plant.t) for motor in board.post.motors]
        whole[down] = np.nan
        self._duty = np.where(np.isfinite(whole), whole, self._duty)
        self._moved = self._moved or bool(self._duty.any())

    def _go(self, t: float) -> None:
        if t > self._plant.t:
            self._plant.advance(t - self._plant.t, self._duty)
            self._stretch.follow(t, self._plant.sensed())

    def _sample(self, board: Board, t: float) -> BoardSample:
        post, data = board.post, self._plant.sim.data
        pF, encoder = np.full(self._sensors, np.nan), np.full(self._motors, np.nan)
        pF[list(post.sensors)] = self._stretch.read(t, post.sensors)
        turns = self._plant.winches.angle[self._plant.winches.order] / _TURN
        mine = list(post.motors)
        encoder[mine] = np.trunc((self._sign * turns)[mine] * self._settings.encoder_counts)
        pose = data.qpos[7 * post.rod : 7 * post.rod + 7]
        speed = data.qvel[6 * post.rod : 6 * post.rod + 6]
        a_B, w_WB, q_WB = self._units[board.number].read(t, xyzw(pose[3:]), np.array(speed[:3]), np.array(speed[3:]))
        return BoardSample(
            board=board.number, t=t, t_board=board.clock(t), pF=pF, encoder=encoder, a_B=a_B, w_WB=w_WB, q_WB=q_WB,
            battery=self._settings.supply_v * self._plant.winches.share, status=board.greeting(t),
        )  # fmt: skip


def _check(world: World, boards: int) -> None:
    for i, fault in enumerate(world.faults):
        board = getattr(fault, "board", 0)
        if board >= boards:
            raise UsageError(
                f"the robot has no board {board}", where=f"world file: faults.{i}.board",
                expected=f"0 to {boards - 1} (boards.layout is {world.boards.layout})", received=str(board),
                hint=f"correct faults.{i}.board in the world file",
            )  # fmt: skip

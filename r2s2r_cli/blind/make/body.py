"""The two bodies that a hidden world can have: the MuJoCo rig (tier B) and our own engine (tier A), behind one face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.rig.effects.base import Law, Scene
from r2s2r_cli.rig.firmware import Firmware
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from schemas.robot import Robot


class Body(Protocol):
    """A robot in a world, without its electronics."""

    def advance(self, dt: float, duty: np.ndarray) -> None:
        """Go on by dt [s] under duties of the drivers, (motor,)."""

    def caps(self) -> np.ndarray:
        """True end caps [m], (cap, 3), frame W."""

    def sensed(self) -> np.ndarray:
        """What the sensors are stretched to, their laws included [m], (cable,)."""

    def keep(self) -> object:
        """The state now, for `restore` of another body of the same kind."""

    def restore(self, state: object) -> None:
        """Another one's state; what laws remember stays theirs."""

    def push(self, velocity: np.ndarray, rate: np.ndarray, let_out: np.ndarray) -> None:
        """Add to the rods' velocities [m/s] in the world and rates [rad/s] in their own axes, (rod, 3), and to the rest
        lengths that the winches have set [m], (actuated,)."""


class Boards(Protocol):
    """The electronics of a body. length: as the host knows it [m], (cable,); duty: what the drivers have, (motor,)."""

    @property
    def duty(self) -> np.ndarray:
        """(motor,)."""

    def hear(self, t: float) -> None:
        """Go on to t [s]; the newest sample of every sensor counts."""

    def length(self) -> np.ndarray:
        """(cable,)."""

    def command(self, duty: np.ndarray) -> None:
        """Set the drivers, now."""


@dataclass(frozen=True)
class _Moment:
    """MuJoCo's state and that of the winches."""

    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    rest: np.ndarray
    acting: np.ndarray
    angle: np.ndarray


class RigBody(Plant):
    """The rig's plant with the laws of a hidden world beside those of its world file."""

    def __init__(self, robot: Robot, world: World, hidden: Hidden, gait: int) -> None:
        self._hidden, self._gait = hidden, gait
        super().__init__(robot, world)

    def caps(self) -> np.ndarray:
        """True end caps [m], (cap, 3)."""
        return self.truth().p_WE

    def keep(self) -> object:
        """The state now."""
        data, winches = self.sim.data, self.winches
        return _Moment(np.array(data.qpos), np.array(data.qvel), np.array(data.ctrl), winches.rest.copy(),
                       winches.acting.copy(), winches.angle.copy())  # fmt: skip

    def restore(self, state: object) -> None:
        """Another one's state."""
        assert isinstance(state, _Moment)  # noqa: S101 - a body's states are its own
        data, winches = self.sim.data, self.winches
        data.qpos[:], data.qvel[:], data.ctrl[:] = state.qpos, state.qvel, state.ctrl
        winches.rest, winches.acting, winches.angle = state.rest.copy(), state.acting.copy(), state.angle.copy()

    def push(self, velocity: np.ndarray, rate: np.ndarray, let_out: np.ndarray) -> None:
        """Add to the rods' velocities [m/s] and rates [rad/s], (rod, 3): MuJoCo has those of a free joint together."""
        self.sim.data.qvel[: 6 * len(rate)] += np.concatenate([velocity, rate], axis=1).ravel()
        self.winches.rest, self.winches.acting = self.winches.rest + let_out, self.winches.acting + let_out

    def _laws(self) -> tuple[Law, ...]:
        scene = Scene(self.robot, self.sim, self.winches.r, np.random.default_rng([self._hidden.seed, 12]))
        return (*super()._laws(), *self._hidden.laws(scene, self._gait))


class RigBoards:
    """The rig's boards, with their clocks, converters and noise."""

    def __init__(self, robot: Robot, body: RigBody) -> None:
        self._firmware, self._body, self._lengths = Firmware(body.robot, body.world, body), body, Lengths.of(robot)
        self._latest = np.full(len(robot.sensors), np.nan)

    @property
    def duty(self) -> np.ndarray:
        """What the drivers have, (motor,)."""
        return self._firmware.duty

    def hear(self, t: float) -> None:
        """Go on to t [s]."""
        for sample in self._firmware.tick(t):
            heard = 1e-12 * sample.pF
            self._latest = np.where(np.isfinite(heard), heard, self._latest)

    def length(self) -> np.ndarray:
        """As the host knows it [m], (cable,)."""
        return self._lengths(self._latest)

    def command(self, duty: np.ndarray) -> None:
        """Set the drivers."""
        self._firmware.command(duty, self._body.t)


def body_of(robot: Robot, hidden: Hidden, gait: int, position: np.ndarray, heading: float) -> Body:
    """The robot put down in a hidden world, its motors as fast as that world makes them. gait: its number, 0-based."""
    fast, world = with_speed(robot, hidden.speed), hidden.world(gait, position, heading)
    if hidden.tier == "B":
        return RigBody(fast, world, hidden, gait)
    from r2s2r_cli.blind.make.engine_body import EngineBody

    return EngineBody(fast, world, hidden, gait)


def boards_of(robot: Robot, body: Body, hidden: Hidden, gait: int) -> Boards:
    """The electronics of a body."""
    if isinstance(body, RigBody):
        return RigBoards(robot, body)
    from r2s2r_cli.blind.make.engine_boards import EngineBoards

    return EngineBoards(body, np.random.default_rng([hidden.seed, 15, gait]), len(robot.motors))


def with_speed(robot: Robot, factor: float) -> Robot:
    """The robot with motors that are faster by a factor."""
    motors = tuple(m.model_copy(update={"no_load_rad_per_s": factor * m.no_load_rad_per_s}) for m in robot.motors)
    return robot.model_copy(update={"motors": motors})

"""The rig's robot runs a gait in a hidden world: plant, boards and our controller in one process, as fast as it goes.

Samples reach the controller as they are taken; the camera is a list of instants at which the caps are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.blind.split import TARGETS
from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.devices.pid import WirePid, WireSteps, ticks
from r2s2r_cli.rig.effects.base import Law, Scene
from r2s2r_cli.rig.firmware import Firmware
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from schemas.robot import Robot

REST_S = 1.0
"""The robot rests so long before its first target."""
HOLD_S = 0.5
"""Between the arrival of all cables and the next target."""
SLOPE_F_PER_M, OFFSET_F = 3e-11, 1.4e-11
"""Of every sensor: calibrated before anything else happened."""


@dataclass(frozen=True)
class Gait:
    """What the robot is told, and where it is put down. targets: positions 0 or 1, (target, actuated)."""

    name: str
    targets: np.ndarray
    position: np.ndarray
    heading: float


@dataclass(frozen=True)
class Moment:
    """A state of the plant that can be put back: MuJoCo's, and that of the winches."""

    t: float
    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    rest: np.ndarray
    acting: np.ndarray
    angle: np.ndarray


@dataclass(frozen=True)
class Driven:
    """One run.

    t: control ticks [s], (tick,). target, control: (tick, actuated), +1 reels in; length: as the host read it then [m],
    (tick, cable). sensed: without the boards' noise [m]; caps: true end caps [m], (tick, cap, 3). duty: on the drivers,
    (tick, motor). t_frame: exposures [s], (frame,); p_WE: true end caps then [m], (frame, cap, 3). starts: ticks at
    which targets begin; moments: the plant then.
    """

    gait: Gait
    t: np.ndarray
    target: np.ndarray
    control: np.ndarray
    length: np.ndarray
    sensed: np.ndarray
    caps: np.ndarray
    duty: np.ndarray
    t_frame: np.ndarray
    p_WE: np.ndarray
    starts: np.ndarray
    moments: tuple[Moment, ...]


class HiddenPlant(Plant):
    """The rig's plant with the laws of a hidden world beside those of its world file."""

    def __init__(self, robot: Robot, world: World, hidden: Hidden, gait: int) -> None:
        self._hidden, self._gait = hidden, gait
        super().__init__(robot, world)

    def _laws(self) -> tuple[Law, ...]:
        scene = Scene(self.robot, self.sim, self.winches.r, np.random.default_rng([self._hidden.seed, 12]))
        return (*super()._laws(), *self._hidden.laws(scene, self._gait))


def hidden_plant(robot: Robot, hidden: Hidden, gait: int, position: np.ndarray, heading: float) -> HiddenPlant:
    """The robot put down in a hidden world, its motors as fast as that world makes them."""
    return HiddenPlant(with_speed(robot, hidden.speed), hidden.world(gait, position, heading), hidden, gait)


def with_speed(robot: Robot, factor: float) -> Robot:
    """The robot with motors that are faster by a factor."""
    motors = tuple(m.model_copy(update={"no_load_rad_per_s": factor * m.no_load_rad_per_s}) for m in robot.motors)
    return robot.model_copy(update={"motors": motors})


def random_gait(name: str, rng: np.random.Generator, actuated: int = 6) -> Gait:
    """Random shapes of short and long cables, each at least two cables away from the one before, at a random place."""
    shape = np.ones(actuated)
    targets: list[np.ndarray] = []
    while len(targets) < TARGETS:
        wanted = rng.integers(0, 2, actuated).astype(float)
        if np.abs(wanted - shape).sum() >= 2:
            targets.append(wanted)
            shape = wanted
    return Gait(name, np.array(targets), rng.uniform(-0.1, 0.1, 2), float(rng.uniform(0, 2 * np.pi)))


def drive(robot: Robot, hidden: Hidden, gait: Gait, number: int, *, exposures: float, phase: float) -> Driven:
    """Run a gait. number: of the gait in its set, 0-based. exposures: a second [Hz]; phase: of the first, 0 .. 1.

    Raises NumericalError where MuJoCo breaks down.
    """
    plant = hidden_plant(robot, hidden, number, gait.position, gait.heading)
    firmware = Firmware(plant.robot, plant.world, plant)
    log = _Log(robot, firmware, plant)
    period = 1.0 / robot.pid.rate_hz
    n = len(robot.actuated)
    targets = np.concatenate([np.ones((1, n)), gait.targets])
    holds = np.array([REST_S, *np.full(len(gait.targets), HOLD_S)])
    steps = WireSteps(ticks(holds, period), ticks(np.full(len(targets), robot.pid.step_timeout_s), period))
    pid = WirePid.of(robot)
    winched = list(robot.actuated)
    scale = np.array([[m.sign * m.speed, winched.index(m.cable)] for m in robot.motors])
    frame, k = 0, 0
    while not steps.finished:
        due = (frame + phase) / exposures
        if due < k * period - 1e-9:
            log.hear(due)
            log.look(due)
            frame += 1
            continue
        log.hear(k * period)
        target = targets[steps.index]
        control = pid.tick(log.length()[winched], target)
        log.tick(k * period, steps.index, target, control, scale[:, 0] * control[scale[:, 1].astype(int)])
        if steps.advance(pid.done)[0]:
            pid.restart()
        k += 1
    return log.done(gait)


class _Log:
    """What the host and the maker write down."""

    def __init__(self, robot: Robot, firmware: Firmware, plant: Plant) -> None:
        self._firmware, self._plant, self._lengths = firmware, plant, Lengths.of(robot)
        self._latest = np.full(len(robot.sensors), np.nan)
        names = ("t", "target", "control", "length", "sensed", "caps", "duty", "t_frame", "p_WE")
        self._rows: dict[str, list[np.ndarray]] = {name: [] for name in names}
        self._starts: list[int] = []
        self._moments: list[Moment] = []

    def hear(self, t: float) -> None:
        """Go on to t [s]; the newest sample of every sensor counts."""
        for sample in self._firmware.tick(t):
            heard = 1e-12 * sample.pF
            self._latest = np.where(np.isfinite(heard), heard, self._latest)

    def length(self) -> np.ndarray:
        """As the host knows it [m], (cable,)."""
        return self._lengths(self._latest)

    def look(self, t: float) -> None:
        """The camera exposes."""
        self._add(t_frame=np.array(t), p_WE=self._plant.truth().p_WE)

    def tick(self, t: float, index: int, target: np.ndarray, control: np.ndarray, duty: np.ndarray) -> None:
        """The controller has decided; index: of the target."""
        if index == len(self._starts):
            self._starts.append(len(self._rows["t"]))
            self._moments.append(moment(self._plant))
        self._firmware.command(duty, self._plant.t)
        self._add(t=np.array(t), target=target.copy(), control=control.copy(), length=self.length(),
                  sensed=self._plant.sensed(), caps=self._plant.truth().p_WE, duty=self._firmware.duty)  # fmt: skip

    def done(self, gait: Gait) -> Driven:
        """The run."""
        rows = {name: np.array(values) for name, values in self._rows.items()}
        return Driven(gait=gait, starts=np.array(self._starts), moments=tuple(self._moments), **rows)

    def _add(self, **values: np.ndarray) -> None:
        for name, value in values.items():
            self._rows[name].append(value)


def moment(plant: Plant) -> Moment:
    """The state of a plant now."""
    data, winches = plant.sim.data, plant.winches
    return Moment(plant.t, np.array(data.qpos), np.array(data.qvel), np.array(data.ctrl), winches.rest.copy(),
                  winches.acting.copy(), winches.angle.copy())  # fmt: skip


def put_back(plant: Plant, at: Moment) -> None:
    """A plant in another one's state; what laws remember stays theirs."""
    data, winches = plant.sim.data, plant.winches
    data.qpos[:], data.qvel[:], data.ctrl[:] = at.qpos, at.qvel, at.ctrl
    winches.rest, winches.acting, winches.angle = at.rest.copy(), at.acting.copy(), at.angle.copy()

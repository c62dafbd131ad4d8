"""The robot runs a gait in a hidden world: body, boards and our controller in one process, as fast as it goes.

Samples reach the controller as they are taken; the camera is a list of instants at which the caps are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.blind.make.body import Boards, Body, boards_of, body_of
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.blind.split import TARGETS
from r2s2r_cli.devices.pid import WirePid, WireSteps, ticks
from schemas.robot import Robot

REST_S = 1.0
"""The robot rests so long before its first target."""
HOLD_S = 0.5
"""Between the arrival of all cables and the next target."""
SLOPE_F_PER_M, OFFSET_F = 3e-11, 1.4e-11
"""Of every sensor: calibrated before anything else happened."""


@dataclass(frozen=True)
class Gait:
    """What the robot is told, and where it is put down. targets: positions 0 .. 1, (target, actuated)."""

    name: str
    targets: np.ndarray
    position: np.ndarray
    heading: float


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
    moments: tuple[object, ...]


def random_gait(name: str, rng: np.random.Generator, actuated: int = 6, count: int = TARGETS) -> Gait:
    """`count` random shapes of short and long cables, each at least two cables away from the one before, at a random
    place."""
    shape = np.ones(actuated)
    targets: list[np.ndarray] = []
    while len(targets) < count:
        wanted = rng.integers(0, 2, actuated).astype(float)
        if np.abs(wanted - shape).sum() >= 2:
            targets.append(wanted)
            shape = wanted
    return Gait(name, np.array(targets), rng.uniform(-0.1, 0.1, 2), float(rng.uniform(0, 2 * np.pi)))


def drive(robot: Robot, hidden: Hidden, gait: Gait, number: int, *, exposures: float, phase: float) -> Driven:
    """Run a gait. number: of the gait in its set, 0-based. exposures: a second [Hz]; phase: of the first, 0 .. 1.

    Raises NumericalError where MuJoCo breaks down.
    """
    body = body_of(robot, hidden, number, gait.position, gait.heading)
    boards = boards_of(robot, body, hidden, number)
    log = _Log(body, boards)
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
            boards.hear(due)
            log.look(due)
            frame += 1
            continue
        boards.hear(k * period)
        target, length = targets[steps.index], boards.length()
        control = pid.tick(length[winched], target)
        log.tick(k * period, steps.index, target, control, length, scale[:, 0] * control[scale[:, 1].astype(int)])
        if steps.advance(pid.done)[0]:
            pid.restart()
        k += 1
    return log.done(gait)


class _Log:
    """What the host and the maker write down."""

    def __init__(self, body: Body, boards: Boards) -> None:
        self._body, self._boards = body, boards
        names = ("t", "target", "control", "length", "sensed", "caps", "duty", "t_frame", "p_WE")
        self._rows: dict[str, list[np.ndarray]] = {name: [] for name in names}
        self._starts: list[int] = []
        self._moments: list[object] = []

    def look(self, t: float) -> None:
        """The camera exposes."""
        self._add(t_frame=np.array(t), p_WE=self._body.caps())

    def tick(
        self, t: float, index: int, target: np.ndarray, control: np.ndarray, length: np.ndarray, duty: np.ndarray
    ) -> None:  # fmt: skip
        """The controller has decided; index: of the target."""
        if index == len(self._starts):
            self._starts.append(len(self._rows["t"]))
            self._moments.append(self._body.keep())
        self._boards.command(duty)
        self._add(t=np.array(t), target=target.copy(), control=control.copy(), length=length,
                  sensed=self._body.sensed(), caps=self._body.caps(), duty=self._boards.duty)  # fmt: skip

    def done(self, gait: Gait) -> Driven:
        """The run."""
        rows = {name: np.array(values) for name, values in self._rows.items()}
        return Driven(gait=gait, starts=np.array(self._starts), moments=tuple(self._moments), **rows)

    def _add(self, **values: np.ndarray) -> None:
        for name, value in values.items():
            self._rows[name].append(value)

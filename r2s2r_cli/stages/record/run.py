"""One run: the loop of samples, controller and commands, with every row on its way to the journal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.devices.lengths import Lengths, believed
from r2s2r_cli.devices.link import LinkStatistics, RobotLink, Sample
from r2s2r_cli.devices.pid import WirePid, WireSteps, ticks
from r2s2r_cli.stages.record.camera import Pictures
from r2s2r_cli.stages.record.intervals import OpenInterval
from r2s2r_cli.stages.record.plan import RunPlan, as_run
from r2s2r_cli.stages.record.tally import Tally
from r2s2r_cli.stages.record.writer import Writer
from schemas.robot import Robot

READ_S = 0.05
"""Longest wait for a sample: how late a dead camera or a full disk is noticed."""
LINK_ROW_S = 1.0
LOOK_S = 0.2
"""Between two calls of `watch`."""


@dataclass(frozen=True)
class Now:
    """How a run stands, for whoever watches. t [s]; target: 1-based, of `targets`; length: of the winched cables [m],
    (actuated,), NaN: no reading; position, aim: positions [1], 0 short .. 1 long; done: (actuated,)."""

    run: str
    t: float
    target: int
    targets: int
    length: np.ndarray
    position: np.ndarray
    aim: np.ndarray
    done: np.ndarray
    rate: float | None
    link: LinkStatistics
    frames: int | None
    frames_lost: int


Watch = Callable[[Now], None]


class RunLoop:
    """The control loop of one run. `run` goes through all targets, `finish` writes what is left, whatever happened.

    The controller acts on samples that are `due`, and on those only; every sample is written down. The clock of the run
    is that of the link: the host's, in lock-step the device's.
    """

    def __init__(self, plan: RunPlan, robot: Robot, link: RobotLink, writer: Writer, watch: Watch) -> None:
        """Raises InputError where the policy is for another robot, or an actuated cable has no calibrated sensor."""
        self.plan, self.link, self._writer, self._watch = plan, link, writer, watch
        period = 1.0 / robot.pid.rate_hz
        self._sequence = as_run(plan, robot)
        self.targets = len(self._sequence.target)
        self.steps = WireSteps(ticks(self._sequence.hold, period), ticks(self._sequence.timeout, period))
        self.timed_out: list[int] = []
        self.hindered: dict[int, list[str]] = {}
        """By target that was given up: which cables were not there, and what they lacked."""
        self._lengths, self._pid, self._robot = Lengths.of(robot), WirePid.of(robot), robot
        self.winched = list(robot.actuated)
        self._driving = np.isin(self._lengths.cable, self.winched)
        self._interval = OpenInterval()
        self._encoder = np.full(len(self.winched), np.nan)
        self._voltage = float("nan")
        self._t0 = link.now()
        self.t = 0.0
        self.tally = Tally(period, link.statistics, len(robot.sensors))
        self._next_link_row = self._next_look = 0.0

    def run(self, pictures: Pictures | None) -> None:
        """All targets, then stop. Raises HardwareError as the link, the camera or the disk does."""
        self._constants()
        while not self.steps.finished:
            sample = self.link.read(READ_S)
            self._writer.check()
            if pictures is not None:
                pictures.check()
            if sample is not None:
                self._take(sample, pictures)
        self.link.stop()

    def finish(self) -> None:
        """Writes the interval that was open, and the state of the link. Raises HardwareError where the disk is full."""
        for stream, row in self._interval.close():
            self._put(stream, row)
        if self.tally.samples:
            self._put("link", self.tally.link_row(self.t, self.link.statistics))

    @property
    def intervals(self) -> int:
        """Target intervals so far, the open one with them."""
        return self._interval.count

    def elapsed(self) -> float:
        """Time of the run by the link's clock [s]."""
        return self.link.now() - self._t0

    def _take(self, sample: Sample, pictures: Pictures | None) -> None:
        t = sample.t_host - self._t0
        if t < 0:  # had been on its way when the run began
            if sample.due:
                self.link.command(np.zeros(len(self.winched)))
            return
        self.t = t
        self.tally.sample(t, sample)
        # Every board tells of its own motors alone, and a tick falls on one of them.
        self._encoder = np.where(np.isfinite(sample.encoder), sample.encoder, self._encoder)
        self._voltage = self._voltage if sample.voltage is None else sample.voltage
        if sample.due:
            self._control(t, sample, pictures)
        self._write(t, sample)
        if t >= self._next_link_row:
            self._put("link", self.tally.link_row(t, self.link.statistics))
            self._next_link_row = t + LINK_ROW_S
        if t >= self._next_look:
            self._watch(self._now(t, sample, pictures))
            self._next_look = t + LOOK_S

    def _control(self, t: float, sample: Sample, pictures: Pictures | None) -> None:
        # Nothing to act on yet where one of them was never heard; a dead sensor of a passive cable holds up nothing.
        if not np.isfinite(sample.t_sensor[self._driving]).all():
            self.link.command(np.zeros(len(self.winched)))
            return
        target = self._sequence.target[self.steps.index]
        lengths = self._lengths(sample.capacitance)
        length = believed(lengths[self.winched], self._robot.limits)
        doubt = sample.doubt or ("" if pictures is None else pictures.doubt)
        # Held: what is recorded is what the motors were told, and the controller has not seen this tick.
        control = np.zeros(len(self.winched)) if doubt else self._pid.tick(length, target)
        self.link.command(control)
        done = self._pid.done.copy()
        self.tally.tick(t, lengths[self._lengths.cable], doubt)
        for stream, row in self._interval.tick(t, target, control, done):
            self._put(stream, row)
        self._put("commands", {"t": t, "target": target, "control": control, "done": done})
        self.tally.turned(control, self._encoder)
        self._put("motors", {"t": t, "position": self._pid.position(lengths[self.winched]), "speed": control,
                             "encoder": self._encoder, "voltage": self._voltage})  # fmt: skip
        number = self._interval.count + 1
        changed, gave_up = self.steps.advance(done)
        if gave_up:
            self.timed_out.append(number)
            self.hindered[number] = _hindered(self.winched, self._pid.position(length) - target, done)
        if changed:
            self._pid.restart()

    def _write(self, t: float, sample: Sample) -> None:
        heard = np.where(sample.fresh, sample.capacitance, np.nan)
        length = self._lengths(heard)[self._lengths.cable]
        self._put("sensors", {"t": t, "t_board": sample.t_board, "board": sample.board, "capacitance": heard,
                              "length": length})  # fmt: skip
        if sample.a_B is not None:
            w_WB = np.full(3, np.nan) if sample.w_WB is None else sample.w_WB
            self._put("imu", {"t": t, "board": sample.board, "a_B": sample.a_B, "w_WB": w_WB})

    def _constants(self) -> None:
        """The policy as it is run, with its rest shapes, and which cable each sensor measures."""
        for target, hold, timeout in zip(*vars(self._sequence).values(), strict=True):
            self._put("policy", {"target": target, "hold": hold, "timeout": timeout})
        for cable in self._lengths.cable:
            self._writer.put(f"runs/{self.plan.name}/sensors:table", {"cable": cable})

    def _put(self, stream: str, row: Mapping[str, Any]) -> None:
        self._writer.put(f"runs/{self.plan.name}/{stream}", row)

    def _now(self, t: float, sample: Sample, pictures: Pictures | None) -> Now:
        length = self._lengths(sample.capacitance)[self.winched]
        at = min(self.steps.index, self.targets - 1)
        return Now(
            run=self.plan.name, t=t, target=at + 1, targets=self.targets, length=length,
            position=self._pid.position(length), aim=self._sequence.target[at], done=self._pid.done.copy(),
            rate=self.tally.rate, link=self.link.statistics,
            frames=None if pictures is None else pictures.written, frames_lost=0 if pictures is None else pictures.lost,
        )  # fmt: skip


def _hindered(cables: Sequence[int], over: np.ndarray, done: np.ndarray) -> list[str]:
    """Cables that are not done, in words. over: position less target, done: (actuated,)."""
    return [
        f"cable {cable} " + ("without reading" if np.isnan(far) else "too long" if far > 0 else "too short")
        for cable, far, there in zip(cables, over, done, strict=True)
        if not there
    ]

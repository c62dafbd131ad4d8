"""The duties of the host: what must stop the robot, whatever the controller wants. A `RobotLink` around another.

The robots of the authors have no watchdog, so nobody else stops them. Stopped is latched: only `reset` goes on. Held is
not: the motors are off while a sensor is in doubt (`Sample.doubt`), and go on with its next change.

| duty | when |
|---|---|
| stale sensors | a winched cable's sensor, or a board, was not heard for 200 ms |
| impossible sensors | a winched cable's sensor sends 0.20 pF (its chip is not set up) for 200 ms |
| frozen sensor | not one change in 0.18 s in which its motor was driven: held; none in 0.8 s: stopped |
| length out of range | outside the limits of robot.toml by more than 20 mm, three messages in a row |
| slow host | readings wait for longer than 200 ms, or never end to wait for 1 s, after a single pause (`pace.py`) |
| time limit | the run takes longer than it was given |
| exit, exception, a signal | leaving the context; `signals.py` turns signals into exceptions |
"""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.devices.link import EMERGENCY, LinkFacts, LinkState, LinkStatistics, RobotLink, SafetyStop, Sample
from r2s2r_cli.hardware.look import look_at
from r2s2r_cli.hardware.pace import Pace
from r2s2r_cli.hardware.watch import STALE, Watch

if TYPE_CHECKING:
    from schemas.robot import Robot

LOOK = 0.02
"""[s] after which the clock is looked at where nothing comes."""
STOOD_STILL = 0.05
"""[s] between two looks at the clock, with which a message says that this machine was busy with something else."""
HELD_UP = 1.0
"""[s] after which a host that never gets to the end of what waits is judged by what it has read."""
BACKLOG = 100_000
"""Messages that are thrown away at the beginning of a run at most."""
SILENT = 5.0
"""[s] of the wall's clock without any message in lock-step, where the world's clock stands still."""


class GuardedLink:
    """A link that stops the robot by itself. dry_run: sensors are read and watched, motors never move.

    time_limit [s]: of a run, from entering or `restart`. Raises InputError where a winched cable's sensor has no line:
    its length could not be watched.
    """

    def __init__(self, link: RobotLink, robot: Robot, *, time_limit: float = math.inf, dry_run: bool = False) -> None:
        self.inner = link
        self.dry_run = dry_run
        self.time_limit = time_limit
        self._watch = Watch(robot, Lengths.of(robot))
        self._pace = Pace(1 / robot.pid.rate_hz)
        self._reason = ""
        self._start = self._heard = self._wall = -math.inf
        self._moving = np.zeros(len(robot.actuated))
        self._next: Sample | None = None
        self._judged = -math.inf
        self._held = ""
        self._looked, self._paused = math.inf, (-math.inf, 0.0)

    @property
    def facts(self) -> LinkFacts:
        """Of the link."""
        return self.inner.facts

    @property
    def state(self) -> LinkState:
        """Of the link."""
        return self.inner.state

    @property
    def statistics(self) -> LinkStatistics:
        """Of the link."""
        return self.inner.statistics

    def now(self) -> float:
        """Of the link."""
        return self.inner.now()

    def __enter__(self) -> Self:
        """Connect; the time limit begins."""
        self.inner.__enter__()
        try:
            self.restart()
        except BaseException:  # nobody leaves a context that was not entered
            self.inner.__exit__(*sys.exc_info())
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop and close."""
        self.inner.__exit__(kind, value, trace)

    def restart(self, *, time_limit: float | None = None) -> None:
        """A new run: the time limit begins anew, what was watched is forgotten, and so is what waits to be read.

        Raises LinkError.
        """
        for _ in range(BACKLOG):
            if self.inner.read(0.0) is None:
                break
        if time_limit is not None:
            self.time_limit = time_limit
        self._start = self._heard = self.now()
        self._wall = time.monotonic()
        self._watch.restart(self._start)
        self._pace.restart(self._start)
        self._next, self._judged, self._held = None, self._start, ""
        self._looked = self._start

    def reconnect(self, timeout: float = 10.0) -> None:
        """Of the link; what was watched is forgotten, the time limit goes on."""
        self.inner.reconnect(timeout)
        self._heard, self._wall = self.now(), time.monotonic()
        self._watch.restart(self._heard)
        self._pace.restart(self._heard)
        self._next, self._judged, self._held = None, self._heard, ""
        self._looked = self._heard

    def read(self, timeout: float) -> Sample | None:
        """As of the link, but looks at the clock in between while nothing comes.

        Raises SafetyStop once a duty asks for it; the motors are stopped by then.
        """
        self._refuse()
        end = self.now() + timeout
        while True:
            left = end - self.now()
            sample, self._next = self._next or self.inner.read(max(0.0, min(left, LOOK))), None
            if sample is not None:
                self._heard, self._wall = self.now(), time.monotonic()
                self._pace.sample(sample)
                self._object(self._watch.sample(sample, self._moving))
                sample = self._hold(sample)
            self._object(self._clock())
            if sample is not None or left <= LOOK:
                return sample

    def command(self, speed: np.ndarray) -> None:
        """As of the link; nothing but zeros in a dry run, and while the motors are held. Raises SafetyStop where the
        robot is stopped."""
        self._refuse()
        self._object(self._clock())
        speed = np.asarray(speed, dtype=np.float64)
        still = self.dry_run or bool(self._held)
        self.inner.command(np.zeros_like(speed) if still and np.isfinite(speed).all() else speed)
        self._moving = np.zeros_like(speed) if still else speed

    def stop(self) -> None:
        """Of the link. Not latched: the next command moves again."""
        self._moving = np.zeros_like(self._moving)
        self.inner.stop()

    def emergency_stop(self) -> None:
        """Stop and latch, here and on the device where it can."""
        self._reason = self._reason or EMERGENCY
        self.inner.emergency_stop()

    def reset(self) -> None:
        """Take the latches off. Raises LinkError where the device does not do it."""
        self.inner.reset()
        self._reason = ""
        self._moving = np.zeros_like(self._moving)
        self.restart()

    def _clock(self) -> str:
        """What the clock objects to; "" nothing.

        Whether something is stale is judged where nothing waits to be read: a host that was held up for a moment has
        the boards' messages in its buffer, one after the other.
        """
        now = self.now()
        if now - self._looked > STOOD_STILL:
            self._paused = (now, now - self._looked)
        self._looked = now
        if now - self._start > self.time_limit:
            return f"time limit: the run has taken {self.time_limit:g} s"
        self._next = self._next or self.inner.read(0.0)
        late = self._pace.look(now, waits=self._next is not None)
        if self._next is not None and now - self._judged < HELD_UP:
            return late
        self._judged = now
        silent = now - self._heard
        if silent > STALE:
            return f"stale sensors: nothing came for {silent * 1e3:.0f} ms{self._excuse(now)}"
        if time.monotonic() - self._wall > SILENT:
            return f"stale sensors: nothing came for {SILENT:g} s"
        reason = self._watch.stale(now)
        if not reason.startswith("stale"):
            return reason or late
        return f"{reason}, the last message of any board {silent * 1e3:.0f} ms ago{self._excuse(now)}"

    def _excuse(self, now: float) -> str:
        """What this machine has to do with it: whether it did not look for a while."""
        end, pause = self._paused
        return f"; this machine itself stood still for {pause * 1e3:.0f} ms of it" if now - end < STALE else ""

    def _hold(self, sample: Sample) -> Sample:
        """The sample, with what is in doubt; where something newly is, after all motors were told 0.

        A command of zeros, not `stop`: the run is not over (the rig's hand would put the robot back in its midst).
        """
        doubt = self._watch.doubt
        if doubt and not self._held:
            self._moving = np.zeros_like(self._moving)
            self.inner.command(self._moving)
        self._held = doubt
        return dataclasses.replace(sample, doubt=doubt) if doubt else sample

    def _object(self, reason: str) -> None:
        if reason:
            self.inner.stop()
            self._moving = np.zeros_like(self._moving)
            self._reason = self._reason or reason
            self._refuse()

    def _refuse(self) -> None:
        if self._reason:
            look = look_at(self.facts.port, self.facts.protocol, reset=self._reason == EMERGENCY)
            raise SafetyStop(f"the robot is stopped: {self._reason}", where=self.facts.port, expected="a healthy robot",
                             received=self._reason, hint=look)  # fmt: skip

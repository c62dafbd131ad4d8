"""A recording: all its runs one after the other, and what is to be said about each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.devices.camera import CameraFeed, Frame
from r2s2r_cli.devices.link import RobotLink
from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.stages.record.camera import LATE_S, Pictures
from r2s2r_cli.stages.record.plan import RunPlan
from r2s2r_cli.stages.record.run import RunLoop, Watch
from r2s2r_cli.stages.record.still import Still
from r2s2r_cli.stages.record.writer import Sink, Writer
from schemas.config import RecordSettings
from schemas.results_record import CameraCounts, RecordReport, RecordRun
from schemas.robot import Robot

CONTROL_SHARE, CAMERA_SHARE = 0.95, 0.98
"""Of control ticks on time and of frames that were kept: below it the report warns."""
_NAMED = 6
"""Targets that were given up which a warning names."""
_HELD = 0.01
"""Share of the control ticks in which the motors were held beyond which the report warns: a healthy sensor whose cable
cannot follow is in doubt now and then."""
_UNTURNED_S = 0.5
"""A motor that is driven for longer both ways without turning is dead, or its encoder is."""
_REPEATED = 3
"""Frames that repeat the one before which are no reason to warn."""
_SILENT = 0.02
"""Share of the control ticks without a reading of a sensor beyond which the report warns."""


@dataclass
class Session:
    """The runs to record, and what became of them: of every run that was begun there is a report, whatever ended it.

    begin: called before every run. started: wall clock of each run that was begun [unix s]; of none in lock-step, whose
    time is the rig's own.
    """

    plans: Sequence[RunPlan]
    robot: Robot
    link: RobotLink
    settings: RecordSettings
    feed: CameraFeed | None = None
    begin: Callable[[], None] = lambda: None
    wall_clock: Callable[[], float] = lambda: float("nan")
    watch: Watch = lambda now: None
    runs: list[RecordRun] = field(default_factory=list)
    started: dict[str, float] = field(default_factory=dict)
    _ahead: float | None = None
    """In lock-step: the link's clock less the camera's [s], as the freshest frame shows it."""

    def record(self, sink: Sink) -> None:
        """All runs. sink: takes their rows. The link is open, and stopped at the end of every run.

        Raises HardwareError (link, camera, disk, a duty of the host), after the motors were told to stop; what was
        recorded is with the sink. InputError for a policy of another robot or a robot that is not calibrated.
        """
        for plan in self.plans:
            with Still(self.link) as still, Writer(sink, lossless=self.link.facts.lock_step) as writer:
                self._one(plan, writer, still)

    def _stamp(self, loop: RunLoop) -> Callable[[Frame], float]:
        """From a frame to its time in the run [s]: when it came; in lock-step by the camera's clock.

        What lies between the two clocks is the same in all runs, and the freshest frame tells it: the first one of a
        later run may have waited since the run before.
        """
        start = loop.link.now() - loop.elapsed()
        if not self.link.facts.lock_step:
            return lambda frame: frame.t_host - start
        known: list[float] = []

        def stamp(frame: Frame) -> float:
            if not known:
                seen = self.link.now() - frame.t_device
                self._ahead = seen if self._ahead is None else min(self._ahead, seen)
                known.append(self._ahead)
            return frame.t_device + known[0] - start

        return stamp

    def report(self) -> RecordReport:
        """What was recorded so far."""
        facts = self.link.facts
        begun = {run.run for run in self.runs}
        return RecordReport(
            port=facts.port, protocol=facts.protocol, stops_by_itself=facts.stops_by_itself,
            clock="board" if facts.lock_step else "host", runs=tuple(self.runs),
            not_begun=tuple(plan.name for plan in self.plans if plan.name not in begun),
        )  # fmt: skip

    def _one(self, plan: RunPlan, writer: Writer, still: Still) -> None:
        self.begin()
        loop = RunLoop(plan, self.robot, self.link, writer, self.watch)
        if not self.link.facts.lock_step:
            self.started[plan.name] = self.wall_clock()
        pictures = None
        ended = "complete"
        try:
            with ExitStack() as stack:
                if self.feed is not None:
                    stamp = self._stamp(loop)
                    pictures = Pictures(
                        self.feed, writer, f"runs/{plan.name}/camera", self.settings, stamp,
                        waits=self.link.facts.lock_step, since=LATE_S,
                    )  # fmt: skip
                    stack.enter_context(pictures)
                # Left before the pictures, whose end waits for all that is to be encoded: the robot would drive on.
                stack.callback(still.begin)
                loop.run(pictures)
        except BaseException as error:
            still.begin()
            ended = error.what if isinstance(error, R2S2RError) else "interrupted"
            raise
        finally:
            try:
                loop.finish()
            finally:
                self.runs.append(_report(loop, pictures, ended))


def _report(loop: RunLoop, pictures: Pictures | None, ended: str) -> RecordRun:
    tally, now = loop.tally, loop.link.statistics
    camera = None
    if pictures is not None:
        rate = pictures.written / loop.t if loop.t > 0 else None
        camera = CameraCounts(
            frames=pictures.written, lost=pictures.lost, repeated=pictures.repeated, rate_hz=rate
        )  # fmt: skip
    done = RecordRun(
        run=loop.plan.name, policy=loop.plan.policy.name, repeat=loop.plan.repeat, ended=ended, targets=loop.targets,
        targets_done=loop.steps.index, timed_out=tuple(loop.timed_out), duration_s=loop.t, ticks=tally.ticks,
        rate_hz=tally.rate, late=tally.late, held=tally.held, samples=tally.samples, lost=tally.since("lost", now),
        repeated=tally.since("repeated", now), reordered=tally.since("reordered", now),
        corrupt=now.corrupt - tally.before.corrupt, gap_max_s=tally.gap_max, latency_median_s=now.latency_median,
        latency_p99_s=now.latency_p99, clock_drift=now.clock_drift, clock_jumps=tally.jumps,
        silent_share=tuple((tally.silent / max(1, tally.ticks)).tolist()), voltage_first_v=tally.voltage_first,
        voltage_last_v=tally.voltage_last, camera=camera,
    )  # fmt: skip
    warnings = _warnings(done, loop, stops_by_itself=loop.link.facts.stops_by_itself)
    return done.model_copy(update={"warnings": tuple(warnings)})


def _warnings(run: RecordRun, loop: RunLoop, *, stops_by_itself: bool) -> list[str]:
    found = []
    if not run.complete:
        left = "" if stops_by_itself else "; the protocol cannot guarantee that the motors stopped"
        found.append(f"ended at target {run.targets_done + 1} of {run.targets}: {run.ended}{left}")
    if run.timed_out:
        targets = "; ".join(f"{number} ({', '.join(loop.hindered[number])})" for number in run.timed_out[:_NAMED])
        more = len(run.timed_out) - _NAMED
        found.append(
            f"{len(run.timed_out)} of {run.targets} targets given up after their time-out: {targets}"
            + (f"; and {more} more" if more > 0 else "")
            + ". A cable that stays too short is held by the others (it is slack), one that stays too long by its load"
        )
    for cable, seconds in zip(loop.winched, loop.tally.unturned, strict=False):
        if seconds > _UNTURNED_S:
            found.append(f"the motor of cable {cable} was driven both ways and its encoder did not turn")
    if run.late > (1 - CONTROL_SHARE) * max(run.ticks, 1):
        found.append(f"{run.late} of {run.ticks} control ticks came more than half a period late")
    if run.held > _HELD * run.ticks:
        why = "; ".join(loop.tally.doubts)
        found.append(f"the motors were held for {run.held} of {run.ticks} control ticks: {why}")
    if run.lost:
        found.append(f"{run.lost} of {run.lost + run.samples} samples were lost on the way")
    if run.corrupt:
        found.append(f"{run.corrupt} lines were corrupt and thrown away")
    if run.clock_jumps:
        found.append(f"a board's clock jumped {run.clock_jumps} times: the stamps of the runs are the host's")
    silent = [f"{i} ({share:.0%})" for i, share in enumerate(np.array(run.silent_share)) if share > _SILENT]
    if silent:
        found.append(f"sensors without a reading: {', '.join(silent)} of the control ticks")
    camera = run.camera
    if camera is not None and camera.lost > (1 - CAMERA_SHARE) * max(camera.frames + camera.lost, 1):
        found.append(f"{camera.lost} of {camera.frames + camera.lost} camera frames were lost")
    if camera is not None and camera.repeated > max(_REPEATED, (1 - CAMERA_SHARE) * camera.frames):
        found.append(f"{camera.repeated} of {camera.frames} camera frames repeat the one before: a frozen camera")
    return found

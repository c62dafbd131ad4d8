"""Runs as the floor sees them: observed caps with their target intervals, and sensor lengths with theirs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.devices.lengths import frozen
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.segments import Intervals
from r2s2r_cli.stages.sensed import columns_of, sensed_lengths
from schemas.robot import Robot


@dataclass(frozen=True)
class SeenRun:
    """A run with end caps: a `stages.measures.steps.ObservedRun`.

    name: iteration and run, `1:crawl`. t: (frame,) [s]. observed: (frame, cap, 3) [m], ground at z = 0. noise: (cap, 3)
    [m]. quality: codes of `schemas.estimate.QUALITY`, (frame, cap). given_up: how many intervals are not complete in
    `intervals` because their target was given up: where the robot was then is no place that it goes to.
    """

    name: str
    t: np.ndarray
    observed: np.ndarray
    noise: np.ndarray
    quality: np.ndarray
    intervals: Intervals
    given_up: int = 0


@dataclass(frozen=True)
class SensedRun:
    """A run with cable sensors. t: (sample,) [s]; length: (sample, sensor) [m], NaN: not in this sample; cable: that
    each sensor measures, (sensor,). given_up: as of `SeenRun`. frozen: cables whose sensor said one value throughout;
    their lengths are NaN here."""

    name: str
    t: np.ndarray
    length: np.ndarray
    cable: np.ndarray
    intervals: Intervals
    given_up: int = 0
    frozen: tuple[int, ...] = ()


def seen_run(name: str, estimate: ArtifactData, recording: ArtifactData | None, run: str) -> SeenRun | None:
    """Of an estimate and its recording; None where the run has no target intervals.

    observed: the recording's caps at the kept frames on the estimate's ground, as the measures want them; where a
    tracker made them on the way, the estimate's. Raises InputError where both do not belong together.
    """
    groups = dict(estimate.streams(run))
    if "intervals" not in groups or not len(groups["intervals"]["t_first"]):
        return None
    frames, tracks, ground = groups["frames"], groups["tracks"], groups["ground"]
    caps = None if recording is None else recording.group(run, "caps")
    observed = frames["p_WE"] if caps is None else _caps_at(caps, frames, ground, name)
    table, given_up = _reached(Intervals.from_group(groups["intervals"]), recording, run)
    return SeenRun(name, frames["t"], observed, tracks["noise_sd"], frames["quality"], table, given_up)


def sensed_run(name: str, recording: ArtifactData, run: str, robot: Robot) -> SensedRun | None:
    """Of a recording, with a column for each sensor of robot.toml; None where the run has no target intervals, or no
    lengths of the robot's sensors."""
    sensors, intervals = recording.group(run, "sensors"), recording.group(run, "intervals")
    if sensors is None or intervals is None or not len(intervals["t_first"]):
        return None
    found = sensed_lengths(sensors, robot)
    if found is None:
        return None
    cable = np.array([sensor.cable for sensor in robot.sensors], dtype=np.int64)
    length = columns_of(*found, cable.tolist())
    if not np.isfinite(length).any():
        return None
    stuck = np.array([frozen(column[np.isfinite(column)]) for column in length.T])
    length[:, stuck] = np.nan  # it repeats itself perfectly, and measures nothing
    reached = _reached(Intervals.from_group(intervals), recording, run)
    return SensedRun(name, sensors["t"], length, cable, *reached, tuple(cable[stuck].tolist()))


def _reached(table: Intervals, recording: ArtifactData | None, run: str) -> tuple[Intervals, int]:
    """The intervals, complete only where all cables were done by their end, and how many that changed.

    A recording without done flags (of another program) says nothing of it: all stay as they are.
    """
    commands = None if recording is None else recording.group(run, "commands")
    if commands is None or "done" not in commands:
        return table, 0
    t, target = commands["t"], commands["target"]
    done: np.ndarray = np.all(commands["done"], axis=1)
    ends = np.append(table.t_first[1:], np.inf)  # done flags stay until the next target
    reached = np.array([
        # Up to the frame that first shows the next target its ticks lie in this span, too, and may be done at once.
        bool(done[(t >= a) & (t < b) & (target == own).all(axis=1)].any())
        for a, b, own in zip(table.t_first, ends, table.target, strict=True)
    ])  # fmt: skip
    complete = table.complete & reached
    return replace(table, complete=complete), int((table.complete & ~reached).sum())


def _caps_at(caps: Group, frames: Group, ground: Group, name: str) -> np.ndarray:
    rows = frames["source_frame"]
    if int(rows.max()) >= len(caps["p_WE"]) or not np.array_equal(caps["t"][rows], frames["t"]):
        raise InputError(
            f"the estimate of run {name} was made of another recording", where="frames/source_frame",
            expected="rows of the recording, with its stamps", received=f"rows up to {int(rows.max())}",
            hint="r2s2r estimate",
        )  # fmt: skip
    return np.asarray(caps["p_WE"][rows] + np.array([0.0, 0.0, float(ground.attributes["shift"])]))

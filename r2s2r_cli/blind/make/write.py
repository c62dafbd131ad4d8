"""A set on disk: robot.toml, gaits/ and commissioning/ as trajectory CSVs with sidecars, or as recordings with
pictures. No world, seed or label."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.blind.make.drive import OFFSET_F, SLOPE_F_PER_M, Driven
from r2s2r_cli.blind.make.film import film
from r2s2r_cli.blind.make.observe import Seen, seen
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.blind.recorded import SUFFIX, write_recording
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.segments import segments, target_intervals
from schemas.robot import Robot

ROBOT = "threebar"
SOURCE = "blind trial: which robot, which world and which day is not said"
TIMEOUT_S = 3.0
"""Targets that a shape cannot reach are given up after this time."""
_SAME_S = 5e-4
"""A frame that falls on a control tick shares its row."""


def robot_text(tolerance: float) -> str:
    """robot.toml of a set: the known robot, its sensors calibrated, the controller's tolerance that of the set."""
    import tomlkit

    facts = tomlkit.parse(robot_toml(ROBOT))
    facts["pid"]["tolerance"], facts["pid"]["step_timeout_s"] = tolerance, TIMEOUT_S  # type: ignore[index]
    for sensor in facts["sensors"]:  # type: ignore[union-attr]
        sensor["slope_f_per_m"], sensor["offset_f"] = SLOPE_F_PER_M, OFFSET_F  # type: ignore[index]
    return tomlkit.dumps(facts)


def write_seen(
    folder: Path, run: Driven, hidden: Hidden, number: int, robot: Robot, rng: np.random.Generator
) -> None:  # fmt: skip
    """What the camera of a hidden world makes of a run, and what the host wrote down meanwhile. number: of the gait in
    its set, 0-based; rng: of the camera's noise."""
    camera = hidden.world(number, run.gait.position, run.gait.heading).seen()
    if hidden.camera:
        folder.mkdir(parents=True, exist_ok=True)
        streams = _streams(run, robot) | {"camera": film(run, camera, robot, rng)}
        write_recording(folder / f"{run.gait.name}{SUFFIX}", streams)
    else:
        write_run(folder, run, seen(run, camera, hidden, rng), robot)


def _streams(run: Driven, robot: Robot) -> dict[str, Group]:
    """What the host knows at its ticks, as the streams of a recording."""
    pid = robot.pid
    facts: dict[str, Scalar] = {
        "origin": "rig", "nature": "simulated", "source": SOURCE, "robot": robot.name, "pid_p": pid.p, "pid_i": pid.i,
        "pid_d": pid.d, "pid_tolerance": pid.tolerance, "pid_min_length": pid.min_length_m, "pid_range": pid.range_m,
    }  # fmt: skip
    intervals = target_intervals(run.t, run.target, control=run.control)
    return {
        "": Group(attributes=facts),
        "commands": Group({"t": run.t, "target": run.target, "control": run.control}),
        "sensors": Group({"t": run.t, "length": run.length, "cable": np.arange(run.length.shape[1])}),
        "intervals": intervals.to_group(),
        "segments": segments(intervals, run.t, run.control).to_group(),
    }


def write_run(folder: Path, run: Driven, seen: Seen, robot: Robot) -> None:
    """`<gait>.csv` and its sidecar: rows at control ticks and at frames, caps NaN where no frame is."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = folder / run.gait.name
    # What was seen before the log begins, or after it ends, is in no log.
    inside = (seen.t >= 0.0) & (seen.t <= run.t[-1])
    t_frame, p = seen.t[inside], seen.p_WE[inside]
    tick = np.clip(np.searchsorted(run.t, t_frame), 1, len(run.t) - 1)
    tick = np.where(t_frame - run.t[tick - 1] < run.t[tick] - t_frame, tick - 1, tick)
    t_frame = np.where(np.abs(t_frame - run.t[tick]) < _SAME_S, run.t[tick], t_frame)
    t = np.union1d(run.t, t_frame)
    row = np.clip(np.searchsorted(run.t, t, side="right") - 1, 0, None)
    caps = np.full((len(t), p[0].size), np.nan)
    caps[np.searchsorted(t, t_frame)] = p.reshape(len(p), -1)
    table = np.column_stack([t, caps, run.target[row], run.control[row], run.length[row]])
    n, m = p.shape[1], run.target.shape[1]
    names = ["t_s", *(f"cap{i}_{axis}_m" for i in range(n) for axis in "xyz"), *(f"target{k}" for k in range(m))]
    names += [*(f"control{k}" for k in range(m)), *(f"length{j}_m" for j in range(run.length.shape[1]))]
    # Targets of gaits by chance are whole numbers; a suggested one may stop a cable on its way.
    places = 0 if (run.target == run.target.round()).all() else 3
    digits = [4] + [5] * (3 * n) + [places] * m + [3] * m + [5] * run.length.shape[1]
    lines = [",".join(names)]
    lines += [",".join("nan" if x != x else f"{x:.{d}f}" for x, d in zip(r, digits, strict=True)) for r in table]
    stem.with_suffix(".csv").write_text("\n".join(lines) + "\n", encoding="ascii")
    pid = robot.pid
    facts = [
        f'robot = "{robot.name}"', f'source = "{SOURCE}"', 'nature = "simulated"', "", "[pid]", f"p = {pid.p}",
        f"i = {pid.i}", f"d = {pid.d}", f"tolerance = {pid.tolerance}", f"min_length_m = {pid.min_length_m}",
        f"range_m = {pid.range_m}",
    ]  # fmt: skip
    stem.with_suffix(".toml").write_text("\n".join(facts) + "\n", encoding="ascii")

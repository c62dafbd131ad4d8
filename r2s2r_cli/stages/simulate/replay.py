"""Recorded motor commands as the simulator takes them: one row an engine step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError, quoted


@dataclass(frozen=True)
class Replay:
    """Commands of a recorded run from t_first to t_last [s], the clock of the recording.

    t: (row,) [s]; target, control: (row, actuated), +1 reels in; a command holds until the next. target NaN: none.
    missing: rows whose control was not logged, replayed as 0.
    """

    run: str
    t: np.ndarray
    target: np.ndarray
    control: np.ndarray
    t_first: float
    t_last: float
    missing: int

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Target and control at times t (n,) [s], each (n, actuated); before the first command none, and 0."""
        row = np.searchsorted(self.t, t + 1e-9, side="right") - 1
        before = (row < 0)[:, None]
        row = np.maximum(row, 0)
        return np.where(before, np.nan, self.target[row]), np.where(before, 0.0, self.control[row])

    def group(self) -> Group:
        """The commands between start and end as a group of the simulation."""
        rows = (self.t >= self.t_first) & (self.t <= self.t_last)
        return Group({"t": self.t[rows], "target": self.target[rows], "control": self.control[rows]})


def recorded_commands(data: ArtifactData, run: str, motors: int, *, source: str = "10-record.h5") -> Replay:
    """The motor commands of a run of a recording or an estimate; from its first to its last frame where it has frames.

    source: the artifact's file. Raises InputError where the run has none, or those of another robot.
    """
    commands, frames = data.group(run, "commands"), data.group(run, "frames")
    logged = commands is not None and "control" in commands and bool(np.isfinite(commands["control"]).any())
    if commands is None or not logged:
        raise InputError(
            f"run {run} has no motor commands to replay",
            where=f"runs/{run}/commands/control",
            expected="motor commands in -1 .. +1, as control columns of a log bring them",
            received="targets only" if commands is not None else "no commands",
            hint=f"r2s2r inspect {quoted(source)}"
            if commands is None
            else f"r2s2r simulate {quoted(f'{source}:{run}')}   # its targets, with the simulated controller",
        )
    control = commands["control"]
    if control.shape[1] != motors:
        raise InputError(f"run {run} was recorded on another robot", where=f"runs/{run}/commands/control",
                         expected=f"{motors} motors, as robot.toml has", received=str(control.shape[1]),
                         hint="r2s2r validate")  # fmt: skip
    t = commands["t"]
    first, last = (float(t[0]), float(t[-1])) if frames is None else (float(frames["t"][0]), float(frames["t"][-1]))
    if last <= first:
        raise InputError(f"run {run} has no duration to replay", where=f"runs/{run}/commands/t",
                         expected="commands over some time", received=f"{last - first:g} s",
                         hint=f"r2s2r inspect {quoted(source)}")  # fmt: skip
    missing = int((~np.isfinite(control)).any(axis=1).sum())
    return Replay(run, t, commands["target"], np.clip(np.nan_to_num(control), -1, 1), first, last, missing)

"""Which moment of a log is which moment of a simulation that has the controller inside.

A simulation begins at a frame and runs in stamps of frames: a frame stamped t shows the robot at t - camera_delay. A
row of the log stamped t holds the command that the controller sent at t, which reaches the winch command_delay later.
So in stamps of frames the controller's tick of log time t reads the robot, and switches its target, at
t + camera_delay, and its command acts at t + camera_delay + command_delay, as in command replay.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData

if TYPE_CHECKING:
    from r2s2r_cli.engine import Link


@dataclass(frozen=True)
class Switches:
    """When the targets of a run were given, on the clock of its log. at: of each interval [s], (interval,); spread: how
    far that is known, sd [s], (interval,). end: the last frame of the last interval [s], which nobody saw end."""

    at: np.ndarray
    spread: np.ndarray
    end: float

    def took(self, numbers: tuple[int, ...]) -> np.ndarray:
        """How long intervals (1-based) took [s]: until the next was given."""
        every = np.append(self.at, self.end)
        return np.asarray(every[np.array(numbers)] - every[np.array(numbers) - 1])

    def between(self, numbers: tuple[int, ...]) -> np.ndarray:
        """How far the switches are known that begin consecutive intervals, and end the last, sd [s], (n + 1,); inf
        for the end of the run."""
        every = np.append(self.spread, np.inf)
        return np.asarray(every[numbers[0] - 1 : numbers[-1] + 1])


def switches(run: RunData) -> Switches:
    """Where rows are what frames found in force, a target was given somewhere between two rows: half-way, as commands
    are taken to be (`CommandLog`). Rows as they were sent have their stamps."""
    first = run.intervals.first
    at, gap = run.t[first], np.zeros(len(first))
    row = np.searchsorted(run.t_command, at + 1e-9, side="right") - 1  # the row in force at the first frame
    if run.sampled:
        before = run.t_command[np.maximum(row - 1, 0)]
        gap = run.t_command[row] - before
        at = run.t_command[row] - gap / 2
    else:
        changed = np.array([_begin(run.target, one) for one in row])
        at = run.t_command[changed]
    return Switches(at, gap / np.sqrt(12.0), float(run.t[run.intervals.last[-1]]))


def link_between(
    run: RunData, start: float, switch: float, *, period: float, command_delay: np.ndarray, camera_delay: np.ndarray
) -> Link:
    """The link of a simulation that begins at the frame stamped `start` [s], whose first target is given at `switch`
    on the clock of the log. command_delay, camera_delay: [s], (B,).

    Until the controller takes over, what the log says is sent: nothing later than the start and `switch` is read.
    """
    import torch

    from r2s2r_cli.engine import Link

    lead = np.maximum(np.round((switch + camera_delay - start) / period - 1e-9), 0.0).astype(int)
    known = int(np.ceil(np.max(command_delay) / period)) + 2 + int(lead.max())
    ticks = lead[:, None] - known + np.arange(known)
    middle = start + (ticks + 0.5) * period - camera_delay[:, None]
    log = CommandLog(run)
    sent = log.at(np.minimum(middle, max(switch, start)).reshape(-1)).reshape(*middle.shape, -1)
    return Link(torch.as_tensor(command_delay)[:, None], torch.as_tensor(sent), torch.as_tensor(lead))


def _begin(target: np.ndarray, row: int) -> int:
    """The first of the consecutive rows with the same target as `row`."""
    same = (target[: row + 1] == target[row]).all(axis=1)
    different = np.flatnonzero(~same)
    return int(different[-1]) + 1 if len(different) else 0

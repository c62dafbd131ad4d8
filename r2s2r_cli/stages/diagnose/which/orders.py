"""The recorded commands of stretches, for many hypotheses with delays of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData


class Orders:
    """Command logs of runs, each made once: stretches have frames of their own, and the commands of their run."""

    def __init__(self, actuated: int) -> None:
        self.actuated = actuated
        self._logs: dict[tuple[int, int, bool], tuple[RunData, CommandLog]] = {}

    def means(
        self, many: Sequence[Stretch], rows: int, delays: np.ndarray, *, step: float, before: float = 0.0
    ) -> np.ndarray:  # fmt: skip
        """`rows` commands of `step` seconds, from `before` [s] ahead of the begin of every stretch on, for delays (k,)
        [s], (k, stretch, row, actuated)."""
        own, back = np.unique(delays, return_inverse=True)
        logs = [self._log(one.window.run) for one in many]
        made = np.empty((len(own), len(many), rows, self.actuated))
        for log in dict.fromkeys(logs):
            places = [i for i, one in enumerate(logs) if one is log]
            starts = np.array([many[i].window.start for i in places]) - before
            made[:, places] = log.all_means(starts, rows, step=step, delays=own)
        return made[back]

    def _log(self, run: RunData) -> CommandLog:
        key = (id(run.t_command), id(run.control), run.sampled)
        if key not in self._logs:
            self._logs[key] = (run, CommandLog(run))  # the run is kept: nothing else gets these ids
        return self._logs[key][1]

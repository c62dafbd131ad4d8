"""Recorded motor commands on the grid of the engine, shifted by a delay, with the derivative by that delay."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.data import RunData


class CommandLog:
    """The commands of one run as a function of time: 0 before the first row, then piecewise constant.

    Rows that are commands as they were sent hold from their stamps. Where they are what the frames found in force
    (`RunData.sampled`), a command was switched at an unknown moment between two rows; half-way is the guess of
    least variance, and holding until the row that shows it would be half a frame late at every switch.
    """

    def __init__(self, run: RunData) -> None:
        control = np.nan_to_num(run.control)
        switched = np.concatenate([run.t_command[:1], (run.t_command[1:] + run.t_command[:-1]) / 2])
        self._knots = switched if run.sampled else run.t_command
        self._control = np.vstack([np.zeros((1, control.shape[1])), control])
        spans = np.diff(self._knots)[:, None] * control[:-1]
        wound = np.vstack([np.zeros((1, control.shape[1])), np.cumsum(spans, axis=0)])
        # By how many rows have begun: where the last of them did, and what was wound by then.
        self._begun = np.concatenate([self._knots[:1], self._knots])
        self._wound = np.concatenate([wound[:1], wound])

    def at(self, t: np.ndarray) -> np.ndarray:
        """Commands in force at times t (n,) [s], (n, actuated)."""
        return np.asarray(self._control[np.searchsorted(self._knots, t, side="right")])

    def means(self, start: float, count: int, *, step: float, delay: float) -> np.ndarray:
        """`count` commands of `step` seconds from `start` [s], (row, actuated).

        Each is the mean of the delayed command over its step: so the derivative by the delay exists where a switch
        falls into it.
        """
        edges = start + step * np.arange(count + 1) - delay
        return np.asarray(np.diff(self._integral(edges), axis=0) / step)

    def by_delay(self, start: float, count: int, *, step: float, delay: float) -> np.ndarray:
        """Derivatives of the same commands by the delay, (row, actuated) [1/s]."""
        edges = start + step * np.arange(count + 1) - delay
        return np.asarray(-np.diff(self.at(edges), axis=0) / step)

    def all_means(self, starts: np.ndarray, count: int, *, step: float, delays: np.ndarray) -> np.ndarray:
        """The commands from several starts (n,) [s] for several delays (d,) [s], (d, n, row, actuated)."""
        edges = (starts[:, None] + step * np.arange(count + 1)) - delays[:, None, None]
        wound = self._integral(edges.ravel()).reshape(*edges.shape, -1)
        return np.asarray(np.diff(wound, axis=2) / step)

    def _integral(self, t: np.ndarray) -> np.ndarray:
        """Integral of the commands from the first row to t (n,) [s], (n, actuated)."""
        row = np.searchsorted(self._knots, t, side="right")
        found = self._control.take(row, axis=0)  # 0 before the first row
        found *= (t - self._begun.take(row))[:, None]
        found += self._wound.take(row, axis=0)
        return found

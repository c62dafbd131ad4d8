"""The floor of cable lengths: how far the sensors repeat themselves at the end of target intervals of one phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.floor.runs import SensedRun

WINDOW_S = 0.25
"""A sensor's length at the end of an interval is the median of its readings in this time before it."""
_FEWEST = 3
"""Readings of a sensor in a run below which its noise cannot be told."""

Phase = tuple[tuple[float, ...], tuple[float, ...]]
_End = tuple[str, int, np.ndarray]
"""Run, interval, and the lengths at its end (sensor,) [m]."""


@dataclass(frozen=True)
class LengthRepeats:
    """sd, noise: (sensor,) [m], NaN: not heard often enough. contrasts: of each sensor. phases: runs and intervals of
    each. within: the floor with each iteration about its own means [m], None where there is one iteration, or none
    repeats itself."""

    sd: np.ndarray
    noise: np.ndarray
    contrasts: int
    phases: tuple[tuple[tuple[str, int], ...], ...]
    within: float | None = None

    @property
    def floor(self) -> float:
        """Root mean square over the sensors [m]."""
        return float(np.sqrt(np.nanmean(self.sd**2)))


def length_repeats(runs: Sequence[SensedRun]) -> LengthRepeats | None:
    """From complete intervals of one phase (target and the one before it), at least two of each; None without any.

    The variance about the mean of each phase, pooled with n - 1 degrees of freedom: unbiased for independent repeats.
    What the sensors drift between the repeats counts as well. Where the robot stands does not matter to its cables,
    what it stands on does a little: phases are not told apart by that here.
    """
    found: dict[Phase, list[_End]] = {}
    for run in runs:
        table = run.intervals
        for i in range(1, len(table)):
            if table.complete[i - 1 : i + 1].all() and table.first[i] == table.last[i - 1] + 1:
                phase = (tuple(table.target[i - 1].tolist()), tuple(table.target[i].tolist()))
                found.setdefault(phase, []).append((run.name, i + 1, _end(run, float(table.t_last[i]))))
    groups = [group for group in found.values() if len(group) > 1]
    pooled = _pooled(groups)
    if pooled is None:
        return None
    sd, contrasts = pooled
    phases = tuple(tuple((name, number) for name, number, _ in group) for group in groups)
    iterations = {_iteration(name) for phase in phases for name, _ in phase}
    apart = [[end for end in group if _iteration(end[0]) == one] for group in groups for one in sorted(iterations)]
    inside = _pooled([group for group in apart if len(group) > 1]) if len(iterations) > 1 else None
    within = None if inside is None else float(np.sqrt(np.nanmean(inside[0] ** 2)))
    return LengthRepeats(sd, _noise(runs), contrasts, phases, within)


def _iteration(name: str) -> str:
    """Of a run `1:crawl`."""
    return name.partition(":")[0]


def _pooled(groups: Sequence[Sequence[_End]]) -> tuple[np.ndarray, int] | None:
    """Standard deviation about the mean of each group, (sensor,), and its degrees of freedom; None without any."""
    if not groups:
        return None
    squares, freedom = np.zeros(len(groups[0][0][2])), np.zeros(len(groups[0][0][2]))
    for group in groups:
        ends = np.array([end for *_, end in group])
        there = np.isfinite(ends)
        count = there.sum(axis=0)
        mean = np.where(there, ends, 0.0).sum(axis=0) / np.maximum(count, 1)
        squares += np.where(there, (ends - mean) ** 2, 0.0).sum(axis=0)
        freedom += np.maximum(count - 1, 0)
    if not freedom.any():
        return None
    sd = np.sqrt(np.divide(squares, freedom, out=np.full_like(squares, np.nan), where=freedom > 0))
    return sd, int(freedom.max())


def _end(run: SensedRun, t: float) -> np.ndarray:
    """Lengths at the end of an interval, (sensor,) [m]."""
    rows = run.length[(run.t > t - WINDOW_S) & (run.t <= t)]
    heard = np.isfinite(rows).any(axis=0) if len(rows) else np.zeros(run.length.shape[1], dtype=bool)
    found = np.full(run.length.shape[1], np.nan)
    if heard.any():
        found[heard] = np.nanmedian(rows[:, heard], axis=0)
    return found


def _noise(runs: Sequence[SensedRun]) -> np.ndarray:
    """Noise of one reading, (sensor,) [m]: from second differences, which a steady motion does not enter.

    Their variance is 6 sd^2 for white noise; the median of their sizes leaves reversals and jumps out of account.
    """
    found = []
    for sensor in range(runs[0].length.shape[1]):
        pieces = []
        for run in runs:
            values = run.length[:, sensor]
            values = values[np.isfinite(values)]
            if len(values) >= _FEWEST:
                pieces.append(np.abs(np.diff(values, n=2)))
        found.append(np.median(np.concatenate(pieces)) / 0.6745 / np.sqrt(6.0) if pieces else np.nan)
    return np.array(found)

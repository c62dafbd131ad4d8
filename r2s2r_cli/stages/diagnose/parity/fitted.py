"""The part of a run that may be looked at: nothing of judged intervals before everything else is decided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence, Run
from r2s2r_cli.stages.floor.runs import SensedRun
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.segments import Intervals, Segments

Table = TypeVar("Table", Intervals, Segments)


def fitted_runs(evidence: Evidence) -> tuple[Run, ...]:
    """Runs that are fitted; of one with judged intervals the longest block between them, by itself. Stamps stay those
    of the whole run, intervals are counted from 1 again. A run of which nothing is left is not there."""
    found = []
    for run in evidence.only(evidence.fit) or evidence.runs:
        judged = _intervals(evidence.judge, run.name)
        if not judged:
            found.append(run)
        elif block := _block(len(run.caps.intervals), _intervals(evidence.fit, run.name), judged):
            found.append(_cut(run, *block))
    return tuple(found)


def unheard(evidence: Evidence) -> tuple[Run, ...]:
    """All runs, whole, but for what sensors read in judged intervals: how much they scatter is learned from all of a
    run's readings, and those about a key frame reach into the next interval. Caps stay: a start state is that of the
    whole run up to there."""
    found = []
    for run in evidence.runs:
        judged = _intervals(evidence.judge, run.name)
        if run.lengths is None or not judged:
            found.append(run)
            continue
        caps, table = run.caps, run.caps.intervals
        kept = np.ones(len(run.lengths.t), dtype=bool)
        for k in judged:
            first = int(table.first[k - 1])
            begin = _stop(caps, first, table.target[k - 1]) if first else -np.inf
            end = float(caps.t[table.first[k]]) if k < len(table) else np.inf
            kept &= (run.lengths.t < begin) | (run.lengths.t >= end)
        found.append(replace(run, lengths=replace(run.lengths, t=run.lengths.t[kept], length=run.lengths.length[kept])))
    return tuple(found)


def _intervals(part: Sequence[Selection], run: str) -> list[int]:
    return [k for one in part if one.run == run for k in one.intervals]


def _block(count: int, fitted: Sequence[int], judged: Sequence[int]) -> tuple[int, int] | None:
    """First and last interval (1-based) of the block without judged ones that has most fitted ones, the first of equal
    ones; None where none has any."""
    blocks = [(a + 1, b - 1) for a, b in pairwise([0, *sorted(set(judged)), count + 1])]
    sizes = [sum(a <= k <= b for k in fitted) for a, b in blocks]
    best = int(np.argmax(sizes))
    return blocks[best] if sizes[best] else None


def _cut(run: Run, first: int, last: int) -> Run:
    """The run from its interval `first` to `last` (1-based), both within it."""
    caps, table = run.caps, run.caps.intervals
    begin = 0 if first == 1 else int(table.first[first - 1])
    end = len(caps.t) if last == len(table) else int(table.first[last])
    start = float(min(caps.t[0], caps.t_command[0])) if begin == 0 else float(caps.t[begin])
    stop = np.inf if end == len(caps.t) else _stop(caps, end, table.target[last])
    rows, t_command = _commands(caps.t_command, start, stop)
    by_frame = ["t", "observed", "p_WE", "sd_p", "v_WE", "sd_v", "quality"]
    if caps.observed_sd is not None:
        by_frame.append("observed_sd")
    segments = _rows(caps.segments, (caps.segments.interval >= first) & (caps.segments.interval <= last), begin)
    numbers = np.arange(1, len(table) + 1)
    cut = replace(
        caps, **{name: getattr(caps, name)[begin:end] for name in by_frame}, t_command=t_command,
        control=caps.control[rows], target=caps.target[rows],
        intervals=_rows(table, (numbers >= first) & (numbers <= last), begin),
        segments=replace(segments, interval=segments.interval - (first - 1)),
        sensor_bias=None, sensor_delay=None,  # these are of the whole run
    )  # fmt: skip
    lengths = None if run.lengths is None else _heard(run.lengths, -np.inf if begin == 0 else start, stop)
    found = replace(run, caps=cut, lengths=lengths)
    # Smoothed states next to a judged interval know of it; what is seen from the block's own frames on does not.
    seen = found.known
    return replace(found, caps=replace(cut, p_WE=seen.p_WE, v_WE=seen.v_WE, sd_p=seen.sd_p, sd_v=seen.sd_v))


def _stop(caps: RunData, end: int, target: np.ndarray) -> float:
    """When the interval with this target begins whose first frame is `end` [s]: commands may say so before a frame."""
    between = (caps.t_command > caps.t[end - 1]) & (caps.t_command < caps.t[end])
    sent = caps.t_command[between & (caps.target == target).all(axis=1)]
    return float(sent[0]) if len(sent) else float(caps.t[end])


def _commands(t: np.ndarray, start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the command log from `start` to `stop` [s] and their stamps. What is in force at the start may have been
    sent before it: from the start on it is the fitted interval's."""
    rows = np.flatnonzero((t >= start) & (t < stop))
    before = np.flatnonzero(t < start)
    if len(before) and not (len(rows) and t[rows[0]] == start):
        rows = np.concatenate([before[-1:], rows])
    return rows, np.maximum(t[rows], start)


def _heard(run: SensedRun, start: float, stop: float) -> SensedRun:
    """Readings from `start` to `stop` [s], and the intervals whose middle lies there, as far as they were heard."""
    heard = np.flatnonzero((run.t >= start) & (run.t < stop))
    table = run.intervals
    middle = (table.t_first + table.t_last) / 2
    inside = (middle >= start) & (middle < stop) if len(heard) else np.zeros(len(table), dtype=bool)
    own = _rows(table, inside, 0)
    if len(heard):
        first, last = (np.clip(k, heard[0], heard[-1]) for k in (own.first, own.last))
        own = replace(
            own, first=first - heard[0], last=last - heard[0], t_first=np.maximum(own.t_first, run.t[heard[0]]),
            t_last=np.minimum(own.t_last, run.t[heard[-1]]),
        )  # fmt: skip
    return replace(run, t=run.t[heard], length=run.length[heard], intervals=own)


def _rows(table: Table, kept: np.ndarray, frames: int) -> Table:
    """Some rows of a table, whose frames are counted from `frames` on."""
    named = {one.name: getattr(table, one.name) for one in fields(table)}
    own = {name: value[kept] for name, value in named.items() if value is not None}
    return replace(table, **{**own, "first": own["first"] - frames, "last": own["last"] - frames})

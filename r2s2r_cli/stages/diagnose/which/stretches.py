"""Stretches that hypotheses are scored on: end caps and cable lengths at about 10 frames a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.sensor_noise import LENGTH_NOISE_M, noise_of
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.windows import Window, window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State, Structure

APART_S = 0.08
"""Frames nearer than this are averaged: errors of a simulator last longer, and half the frames say as much."""
LEAST_NOISE_M = 5e-4


@dataclass(frozen=True)
class Stretch:
    """One target interval of a run, or a piece of one, with a start state of its own.

    order: 0, 1, ... through the evidence. window: with the thinned frames (F,). piece: 0 for what begins with its
    interval, and the next ones after it. taut (actuated,): rest lengths of winched cables that are just taut where it
    starts [m], None at a first piece; margin [m]: a cable that is longer by more than that hangs. start_sd (offset,):
    of the start state, in the order of `offsets.StartSpread.sd`; None: not known. goes_on [s]: from its last frame to
    where the next one of the run begins. caps: (F, cap, 3) [m]; noise: sd of
    them, (F, cap, 3). length: of the sensors (F, sensor) [m], NaN where not read, or None; length_sd: (F, sensor).
    sensors: cable of each sensor.
    """

    run: str
    gait: str
    interval: int
    order: int
    window: Window
    caps: np.ndarray
    noise: np.ndarray
    length: np.ndarray | None
    length_sd: np.ndarray | None
    sensors: tuple[int, ...]
    piece: int = 0
    taut: np.ndarray | None = None
    margin: float = 0.0
    start_sd: np.ndarray | None = None
    goes_on: float = 0.0

    @property
    def until(self) -> float:
        """Where it is simulated to, on the clock of the run [s]."""
        return float(self.t[-1]) + self.goes_on

    @property
    def t(self) -> np.ndarray:
        """Stamps of the frames [s], (F,)."""
        return self.window.run.t[self.window.frames]

    @property
    def frame_noise(self) -> np.ndarray:
        """Sd of one frame's caps, (cap, 3) [m]; `noise` is of what is averaged of some."""
        return np.maximum(self.window.run.noise, LEAST_NOISE_M)

    @property
    def name(self) -> str:
        """`RUN:3`."""
        return f"{self.run}:{self.interval}"


def begun_at(structure: Structure, one: Stretch, by: np.ndarray) -> Stretch:
    """The stretch from a start with offsets `by` (offset,) (`offsets.displaced`)."""
    import torch

    from r2s2r_cli.engine.flat import pack_state, unpack_state
    from r2s2r_cli.stages.identify.offsets import displaced

    flat = displaced(structure, pack_state(structure, one.window.state), torch.as_tensor(by)[None])
    taut = None if one.taut is None else one.taut + by[-structure.n_actuated :]
    return replace(one, window=replace(one.window, state=unpack_state(structure, flat)), taut=taut)


def stretches(
    runs: Sequence[Run], part: Sequence[Selection], states: Mapping[tuple[str, int], State], *, whole: bool = False
) -> tuple[Stretch, ...]:
    """The intervals of a part of the split. whole: also what comes after a tip-over inside an interval."""
    named = {run.name: run for run in runs}
    found: list[Stretch] = []
    for one in part:
        run = named[one.run]
        for number in one.intervals:
            whole_window = window(run.caps, (number,), states[one.run, number], whole=whole)
            if len(whole_window.frames) >= 2:
                found.append(stretch_of(run, number, whole_window, len(found)))
    return tuple(found)


def stretch_of(run: Run, number: int, own: Window, order: int) -> Stretch:
    """The frames of a window of an interval, averaged where they lie close."""
    caps = run.caps
    groups = _groups(caps.t[own.frames])
    rows = [own.frames[group] for group in groups]
    t = np.array([caps.t[row].mean() for row in rows])
    observed = np.array([caps.observed[row].mean(axis=0) for row in rows])
    share = np.array([1.0 / np.sqrt(len(row)) for row in rows])
    noise = np.maximum(caps.noise, LEAST_NOISE_M)[None] * share[:, None, None]
    length = length_sd = None
    sensors: tuple[int, ...] = ()
    if run.lengths is not None:
        length, length_sd = _lengths(run, t, caps.t[[own.first, *own.frames]])
        sensors = tuple(run.lengths.cable.tolist())
    thin = replace(
        caps,
        t=np.concatenate([caps.t[[own.first]], t]),
        observed=np.concatenate([caps.observed[[own.first]], observed]),
    )
    made = replace(
        own, run=thin, first=0, frames=np.arange(1, len(t) + 1), key=np.arange(len(t)) == len(t) - 1,
        place=np.zeros(len(t), dtype=int),
    )  # fmt: skip
    return Stretch(caps.name, run.gait or caps.name, number, order, made, observed, noise, length, length_sd, sensors)


def _groups(t: np.ndarray) -> list[np.ndarray]:
    """Neighbouring frames that lie within APART_S, the last one alone: it is the key frame."""
    found: list[list[int]] = []
    for k in range(len(t) - 1):
        if found and t[k] - t[found[-1][0]] < APART_S:
            found[-1].append(k)
        else:
            found.append([k])
    return [np.array(group) for group in found] + [np.array([len(t) - 1])]


def _lengths(run: Run, t: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean readings within half a frame of every time, NaN where there is none; and their sd (F, sensor)."""
    sensed = run.lengths
    assert sensed is not None  # noqa: S101
    half = max(APART_S, float(np.median(np.diff(frames))) if len(frames) > 1 else APART_S) / 2
    sd = noise_of(sensed.length)
    mean = np.full((len(t), sensed.length.shape[1]), np.nan)
    count = np.zeros_like(mean)
    for row, at in enumerate(t):
        near = np.abs(sensed.t - at) <= half
        seen = np.isfinite(sensed.length[near])
        count[row] = seen.sum(axis=0)
        total = np.where(seen, sensed.length[near], 0.0).sum(axis=0)
        mean[row] = np.where(count[row] > 0, total / np.maximum(count[row], 1), np.nan)
    return mean, np.maximum(sd / np.sqrt(np.maximum(count, 1)), LENGTH_NOISE_M)

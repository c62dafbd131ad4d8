"""Logs without physics, for the parity checks: rods that move as a formula says, and winches in one dimension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence, Run
from r2s2r_cli.stages.diagnose.parity import Parity
from r2s2r_cli.stages.floor.runs import SensedRun
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.segments import Intervals, Segments
from schemas.robot import Robot
from tests.support.engine import threebar

FRAME_S, TICK_S = 1 / 30, 0.02
INTERVALS, INTERVAL_S = 6, 2.0
SPEED = 23.038 * 0.8 * 0.0035
"""[m/s] of the threebar robot's winches at full command."""


@dataclass(frozen=True)
class Faults:
    """What is wrong in a log. bias, gain: of the sensors, (9,); late: stamps of the camera [s]; scale: its own."""

    bias: np.ndarray | None = None
    gain: np.ndarray | None = None
    late: float = 0.0
    scale: float = 1.0


def caps_at(t: np.ndarray, seed: int) -> np.ndarray:
    """End caps of three rods that sway and turn smoothly, (t, 6, 3) [m]: any motion of rigid rods will do."""
    robot, rng = threebar(), np.random.default_rng(seed)
    rest = np.array(robot.rest_caps_m)
    found = np.empty((len(t), 6, 3))
    for rod in range(3):
        a, b = rest[2 * rod], rest[2 * rod + 1]
        middle, axis = (a + b) / 2, (b - a) / np.linalg.norm(b - a)
        w = 2 * np.pi * rng.uniform(0.25, 0.5, 6)
        phase = rng.uniform(0, 2 * np.pi, 6)
        wave = np.sin(w * t[:, None] + phase)
        moved = middle + 0.012 * wave[:, :3]
        turned = axis + 0.07 * wave[:, 3:]
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        half = robot.rods[rod].length_m / 2
        found[:, 2 * rod], found[:, 2 * rod + 1] = moved - half * turned, moved + half * turned
    return found


def lengths_at(t: np.ndarray, seed: int) -> np.ndarray:
    """Cap distances of all cables, (t, 9) [m]."""
    p, ends = caps_at(t, seed), np.array([cable.caps for cable in threebar().cables])
    return np.asarray(np.linalg.norm(p[:, ends[:, 1]] - p[:, ends[:, 0]], axis=-1))


def swaying(name: str, seed: int, faults: Faults | None = None, *, noise: float = 0.003) -> Run:
    """A run of the swaying rods: commands are what their cables' rates ask for, sensors read with 0.5 mm of noise."""
    faults, rng = faults or Faults(), np.random.default_rng([seed, 1])
    t, ticks = np.arange(0, INTERVALS * INTERVAL_S, FRAME_S), np.arange(0, INTERVALS * INTERVAL_S, TICK_S)
    observed = faults.scale * caps_at(t - faults.late, seed) + noise * rng.standard_normal((len(t), 6, 3))
    true = lengths_at(ticks, seed)
    gain = np.ones(9) if faults.gain is None else faults.gain
    bias = np.zeros(9) if faults.bias is None else faults.bias
    about = true.mean(axis=0)
    heard = about + gain * (true - about) + bias + 5e-4 * rng.standard_normal(true.shape)
    rate = (lengths_at(ticks + 1e-4, seed) - lengths_at(ticks - 1e-4, seed))[:, :6] / 2e-4
    return run_of(name, t, observed, ticks, np.clip(-rate / SPEED, -1.0, 1.0), heard, noise)


def wound(
    name: str, seed: int, law: Callable[[np.ndarray, float], np.ndarray], *, factors: np.ndarray | None = None
) -> Run:
    """A run whose sensors read what a law winds: `law(u, h)` takes commands every h seconds (row, 6) to metres that
    were reeled in (row, 6). The caps stand still: nothing is to be read from them."""
    rng = np.random.default_rng([seed, 2])
    h = 0.001
    grid = np.arange(0, INTERVALS * INTERVAL_S, h)
    u = np.zeros((len(grid), 6))
    inwards = np.ones(6)
    for k in range(INTERVALS):
        chosen = rng.random(6) < 0.7
        begin = np.round((k * INTERVAL_S + 0.2) / h).astype(int)
        u[begin : begin + round(1.2 / h)] = np.where(chosen, inwards, 0.0)
        inwards = np.where(chosen, -inwards, inwards)
    reeled = law(u, h) * (np.ones(6) if factors is None else factors)
    t, ticks = np.arange(0, grid[-1], FRAME_S), np.arange(0, grid[-1], TICK_S)
    rows = np.round(ticks / h).astype(int)
    heard = np.full((len(ticks), 9), 0.17)
    heard[:, :6] = 0.19 - reeled[rows] + 5e-4 * rng.standard_normal((len(ticks), 6))
    still = np.repeat(np.array(threebar().rest_caps_m)[None], len(t), axis=0)
    return run_of(name, t, still + 0.003 * rng.standard_normal(still.shape), ticks, u[rows], heard, 0.003)


def run_of(
    name: str, t: np.ndarray, observed: np.ndarray, ticks: np.ndarray, control: np.ndarray, heard: np.ndarray,
    noise: float,
) -> Run:  # fmt: skip
    """A run from its arrays, with targets that change every INTERVAL_S."""
    begins = INTERVAL_S * np.arange(INTERVALS)
    first = np.searchsorted(t, begins - 1e-9)
    last = np.append(first[1:], len(t)) - 1
    target = np.tile((np.arange(INTERVALS) % 2)[:, None], (1, 6)).astype(float)
    whole = np.ones(INTERVALS, dtype=bool)
    intervals = Intervals(first, last, t[first], t[last], target, whole)
    segments = Segments(np.arange(INTERVALS) + 1, first, last, t[first], t[last], None, whole)
    row = np.minimum((ticks / INTERVAL_S).astype(int), INTERVALS - 1)
    caps = RunData(
        name, t, observed, np.full((6, 3), noise), observed, np.full(observed.shape, noise), np.zeros(observed.shape),
        np.full(observed.shape, 0.02), np.zeros(observed.shape[:2], np.uint8), ticks, control, target[row], intervals,
        segments,
    )  # fmt: skip
    return Run(caps, SensedRun(name, ticks, heard, np.arange(9), intervals), gait=name)


def evidence_of(runs: tuple[Run, ...], healthy: tuple[Run, ...] = (), *, robot: Robot | None = None) -> Evidence:
    """All intervals of all runs to fit."""
    own = robot or threebar()
    fit = tuple(Selection(run.name, tuple(range(1, INTERVALS + 1))) for run in runs)
    return Evidence(own, nominal(own), runs, fit, (), None, healthy)


def with_caps(run: Run, **changed: np.ndarray) -> Run:
    """The run with other arrays of its caps and commands."""
    return replace(run, caps=replace(run.caps, **changed))


def foremost(found: Parity) -> tuple[str, int | None]:
    """The effect, and the index of its element, that the findings say most for [nats]."""
    nats = {(effect, index): said for effect, own in found.nats().items() for index, said in own.items()}
    return max(nats, key=lambda one: nats[one])

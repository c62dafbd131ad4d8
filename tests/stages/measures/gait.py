"""A gait that repeats itself exactly but for what is planted: three phases a cycle, each elsewhere and turned."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.measures.align import PlanarMove
from r2s2r_cli.stages.segments import segments, target_intervals

FRAMES = 6
"""Frames of an interval, 0.1 s apart; the next interval begins 0.1 s later, in the pose of the key frame."""
TARGETS = np.array([[0.1, 0.0], [1.0, 0.1], [1.0, 1.0]])
CYCLE = PlanarMove(0.7, np.array([0.11, -0.04, 0.0]))
"""Where a cycle ends, seen from where it began."""

_rng = np.random.default_rng(7)
SHAPES = _rng.uniform(-0.15, 0.15, (3, 6, 3))
SHAPES[:, :3, 2] = [0.018, 0.019, 0.020]
SHAPES[:, 3:, 2] = [0.08, 0.11, 0.14]


def path(n_intervals: int) -> np.ndarray:
    """End caps at all frames, (frame, cap, 3) [m]: shape to shape with a pace that is not constant."""
    pace = np.linspace(0.0, 1.0, FRAMES)[:, None, None] ** 2
    frames = []
    for i in range(n_intervals):
        here = _place(SHAPES[i % 3], i // 3)
        there = _place(SHAPES[(i + 1) % 3], (i + 1) // 3)
        frames.append(here + pace * (there - here))
    return np.concatenate(frames)


def run(n_intervals: int, *, observed: np.ndarray | None = None, noise: float = 1e-3, name: str = "walk") -> RunData:
    """The gait as a run of a fit; `observed` replaces its end caps, noise: sd that the run states [m]."""
    p_WE = path(n_intervals) if observed is None else observed
    t = 0.1 * np.arange(len(p_WE))
    target = np.repeat(TARGETS[np.arange(n_intervals) % 3], FRAMES, axis=0)
    control = np.zeros_like(target)
    intervals = target_intervals(t, target, control=control)
    return RunData(
        name=name, t=t, observed=p_WE, noise=np.full((6, 3), noise), p_WE=p_WE, sd_p=np.full(p_WE.shape, noise),
        v_WE=np.zeros_like(p_WE), sd_v=np.full(p_WE.shape, noise), quality=np.zeros(p_WE.shape[:2], np.uint8),
        t_command=t, control=control, target=target, intervals=intervals, segments=segments(intervals, t, control),
    )  # fmt: skip


def _place(shape: np.ndarray, cycles: int) -> np.ndarray:
    for _ in range(cycles):
        shape = CYCLE.move(shape)
    return shape

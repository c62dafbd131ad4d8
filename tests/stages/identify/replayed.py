"""Runs of the three-bar robot that the engine simulates by command replay, as a fit gets them, and their predictors."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch

from r2s2r_cli.engine import State
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.free import Mapping, select
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.segments import segments, target_intervals
from tests.support.engine import simulator, threebar
from tests.support.robots import rested

STEP, PERIOD = 1e-3, 0.05
"""Of the engine and of the camera [s]."""
GAIT = np.array(
    [[1, 0, 0, -1, 0, 0], [0, 1, 0, 0, -1, 0], [-1, 0, 1, 0, 0, -1], [0, -1, 0, 1, 0, 1], [1, 0, -1, -1, 1, 0]]
)
"""Motor commands of each interval; +1 reels in."""


def predictor_of(*specs: str, fixed: dict[str, float] | None = None) -> Predictor:
    """The robot with these numbers free, on one thread; structures are compiled once a session."""
    mapping = Mapping(threebar(), select(specs, threebar()), fixed=fixed)
    made = Predictor(mapping, step=STEP, threads=1)
    made.simulator = simulator(mapping.structure)
    return made


def start() -> State:
    """The robot at rest: where every run starts."""
    return rested().state


@lru_cache
def walk(
    intervals: int = 3, *, seconds: float = 0.6, values: tuple[tuple[str, float], ...] = (), noise: float = 0.0,
    seed: int = 0, name: str = "walk",
) -> RunData:  # fmt: skip
    """GAIT from rest, `seconds` an interval, a frame every 50 ms with white noise of sd `noise` [m].

    values: of the robot, by name; the others are robot.toml's. Commands act at their stamps; simulated by the engine
    alone, without what is under test.
    """
    names = [one for one, _ in values]
    mapping = Mapping(threebar(), select(names, threebar()))
    frames = round(intervals * seconds / PERIOD)
    number = np.minimum(np.arange(frames + 1) * PERIOD // (seconds - 1e-9), intervals - 1).astype(int)
    control, each = GAIT[number].astype(float), round(PERIOD / STEP)
    rows = torch.as_tensor(np.repeat(control[:frames], each, axis=0))[None]
    theta = mapping.theta(np.array([value for _, value in values]))
    path = simulator(mapping.structure).rollout(theta, start(), rows, step=STEP, every=each).end_caps()[0].numpy()
    t, target = PERIOD * np.arange(frames + 1), 0.1 * number[:, None] * np.ones(6)
    table = target_intervals(t, target)
    seen = path + noise * np.random.default_rng(seed).normal(size=path.shape)
    sd = np.full(path.shape, max(noise, 1e-4))
    return RunData(
        name=name, t=t, observed=seen, noise=sd[0], p_WE=path, sd_p=sd, v_WE=np.gradient(path, PERIOD, axis=0), sd_v=sd,
        quality=np.zeros(path.shape[:2], np.uint8), t_command=t, control=control, target=target, intervals=table,
        segments=segments(table, t, control),
    )  # fmt: skip


def values_at(predictor: Predictor, **values: float) -> np.ndarray:
    """Starts of the free numbers, but for those given."""
    return np.array([values.get(free.name, free.start) for free in predictor.mapping.frees])

"""Runs of the three-bar robot that the engine simulates with the controller inside, as a camera and a log show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from r2s2r_cli.engine import Link, closed_loop, settled
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.free import Mapping, select
from r2s2r_cli.stages.segments import segments, target_intervals
from tests.support.engine import simulator, threebar
from tests.support.robots import frames, rested, subject

GAIT = np.array([[0.1, 0, 0.1, 0, 0, 0], [1, 0.1, 1, 0, 0, 0], [1, 1, 0.1, 0, 0, 0], [0.1, 0, 0.1, 0, 0, 0]])
"""Targets of the crawl."""


def crawl(
    count: int = 4, *, values: tuple[tuple[str, float], ...] = (), noise: float = 1e-3, seed: int = 0,
    camera: float = 0.05, biased: float = 0.0,
) -> RunData:  # fmt: skip
    """The first `count` targets from rest with these numbers, by name; a frame every `camera` seconds with white noise,
    stamped late by camera_delay, and a row of the log with it. biased: what the sensors read too much [m]."""
    mapping = Mapping(threebar(), select([name for name, _ in values], threebar()))
    x = np.array([value for _, value in values])
    seen, pid = mapping.observation(x), mapping.pid(torch.as_tensor(x))
    theta, start = mapping.theta(torch.as_tensor(x)), rested().state
    if any(name.startswith("attachment") for name, _ in values):
        caps = subject().p_WE
        start = settled(simulator(mapping.structure), theta, caps, frames(caps), subject().cable_caps).state
    targets, none = torch.as_tensor(GAIT[:count]), torch.zeros(count, dtype=torch.float64)
    with torch.no_grad():
        run = closed_loop(
            simulator(mapping.structure), theta, start,
            replace(pid, min_length=pid.min_length - biased), targets, none, none + 6.0, tail=0.3,
            link=Link(seen.command_delay),
        )  # fmt: skip
    caps, last = run.trajectory.end_caps()[0].numpy(), int(run.ticks[0])
    t = np.arange(0.0, last * pid.period + 1e-9, camera)
    at = np.maximum(t - seen.camera_delay, 0.0) / pid.period
    low = np.minimum(np.floor(at + 1e-9).astype(int), len(caps) - 2)
    path = caps[low] + (at - low)[:, None, None] * (caps[low + 1] - caps[low])
    row = np.minimum(np.floor(t / pid.period + 1e-9).astype(int), last - 1)
    target, control = GAIT[run.index[0].numpy()[row].clip(max=count - 1)], run.u[0].numpy()[row]
    table = replace(target_intervals(t, target, control=control), complete=np.ones(count, dtype=bool))
    sd = np.full(path.shape, max(noise, 1e-4))
    return RunData(
        name="crawl", t=t, observed=path + noise * np.random.default_rng(seed).normal(size=path.shape), noise=sd[0],
        p_WE=path, sd_p=sd, v_WE=np.gradient(path, camera, axis=0), sd_v=sd,
        quality=np.zeros(path.shape[:2], np.uint8), t_command=t, control=control, target=target, intervals=table,
        segments=segments(table, t, control), sampled=True,
    )  # fmt: skip

"""Many candidates for the parameters through the engine at once: end caps of all windows, without derivatives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.offsets import displaced
from r2s2r_cli.stages.identify.predict import STRIDE, Predictor
from r2s2r_cli.stages.identify.prediction import alike
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, Structure

TINY = 1e-6
"""Of a step: stamps are decimal numbers, and not exact."""
MOST = 256
"""Simulations in one batch: beyond, their stored states fill the memory and nothing gets faster."""


def predict_candidates(
    predictor: Predictor, windows: Sequence[Window], values: np.ndarray, offsets: np.ndarray | None = None
) -> np.ndarray:
    """End caps (k, F, cap, 3) [m] at the compared frames of all windows, one after the other, at parameter values
    (k, n); start states moved by offsets (k, W, offset), None: not moved.

    The same as `Predictor.predict` of each, but what leaves the finite numbers is nan and raises nothing: one bad
    candidate does not spoil the others.
    """
    whole = longest(windows) if offsets is None else list(range(len(windows)))
    run = sorted(set(whole))
    parts: dict[int, np.ndarray] = {}
    for group in alike([windows[k] for k in run]):
        own = [run[k] for k in group]
        together = max(1, MOST // len(own))
        chunks = []
        for first in range(0, len(values), together):
            some = slice(first, first + together)
            moved = None if offsets is None else offsets[some][:, own]
            chunks.append(_together(predictor, [windows[k] for k in own], values[some], moved))
        for place, k in enumerate(own):
            parts[k] = np.concatenate([chunk[place] for chunk in chunks])
    found = [
        parts[other][:, np.isin(windows[other].frames, window.frames)]
        for window, other in zip(windows, whole, strict=True)
    ]
    return np.concatenate(found, axis=1)


def longest(windows: Sequence[Window]) -> list[int]:
    """For each window the number of the one that simulates it as well: the longest with the same start, itself
    perhaps."""
    best: dict[tuple[int, int, int], int] = {}
    keys = [(id(window.run), window.first, id(window.state)) for window in windows]
    for k, key in enumerate(keys):
        if key not in best or windows[best[key]].duration < windows[k].duration:
            best[key] = k
    return [
        best[key] if set(window.frames.tolist()) <= set(windows[best[key]].frames.tolist()) else k
        for k, (key, window) in enumerate(zip(keys, windows, strict=True))
    ]


def _together(
    predictor: Predictor, windows: Sequence[Window], values: np.ndarray, offsets: np.ndarray | None
) -> list[np.ndarray]:
    """End caps (k, frame, cap, 3) of each of some windows of about the same length."""
    import torch

    from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state

    structure, step, k = predictor.structure, predictor.step, len(values)
    own = predictor.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    theta = own.map(lambda x: x.expand(k, *x.shape[1:]).repeat_interleave(len(windows), dim=0))
    s0 = torch.cat([pack_state(structure, window.state) for window in windows]).repeat(k, 1)
    if offsets is not None:
        s0 = displaced(structure, s0, torch.as_tensor(offsets.reshape(len(s0), -1)))
    duration = max(window.duration for window in windows)
    stride = _stride(windows, step)
    rows = stride * (math.ceil(duration / step / stride - TINY) + 1)
    seen = [predictor.mapping.observation(value) for value in values]
    u = _commands(predictor, windows, [one.command_delay + one.camera_delay for one in seen], rows)
    up = np.array([one.ground_height for one in seen])
    predictor.rollouts += len(s0)
    n = predictor.simulator.substeps(theta, unpack_state(structure, s0), step)
    # Nobody differentiates, so the states need no copy of their own, which `Simulator.advance` makes: they are large.
    kernels, threads = predictor.simulator.kernels, predictor.simulator.threads
    with torch.no_grad():
        p = pack_parameters(structure, theta)
        flat = kernels.forward(s0, u, p, h=step / n, hold=n, every=stride * n, threads=threads)
        return [
            _caps(predictor.structure, own, up, flat[place :: len(windows)], window, stride * step)
            for place, window in enumerate(windows)
        ]


def _stride(windows: Sequence[Window], step: float) -> int:
    """Steps between stored states: `STRIDE`, or a multiple on which all frames lie, as those of simulated runs do."""
    at = np.concatenate([window.run.t[window.frames] - window.start for window in windows]) / step
    common = int(np.gcd.reduce(np.round(at).astype(int))) if len(at) else STRIDE
    return common if common > STRIDE and np.abs(at - np.round(at)).max() < TINY else STRIDE


def _commands(predictor: Predictor, windows: Sequence[Window], delays: Sequence[float], rows: int) -> Tensor:
    """Commands (k W, row, actuated) of each candidate with its own of the delays (k,) [s]."""
    import torch

    logs = {id(window.run): CommandLog(window.run) for window in windows}
    made = {
        (place, delay): logs[id(window.run)].means(window.start, rows, step=predictor.step, delay=delay)
        for place, window in enumerate(windows)
        for delay in set(delays)
    }
    return torch.as_tensor(np.stack([made[place, delay] for delay in delays for place in range(len(windows))]))


def _caps(
    structure: Structure, own: Parameters, up: np.ndarray, flat: Tensor, window: Window, every: float
) -> np.ndarray:
    """End caps (k, frame, cap, 3) at the frames of a window, from its states (k, stored, NS) every so many seconds.

    own: parameters of the candidates, batch k or 1; up: height of the ground that each is seen on, (k,) [m].
    """
    import torch

    from r2s2r_cli.engine import end_caps, observe
    from r2s2r_cli.engine.flat import unpack_state
    from r2s2r_cli.engine.hooks import effective

    at = torch.as_tensor((window.run.t[window.frames] - window.start) / every)
    low = (at + TINY).floor().long()
    share = (at - low)[None, :, None]
    states = flat[:, low] * (1 - share) + flat[:, low + 1] * share
    k, frames = states.shape[:2]
    theta = effective(structure, own)
    # On their rods: all of the parameters that end caps are read off.
    theta = replace(theta, p_BE=theta.p_BE.expand(k, -1, -1, -1).repeat_interleave(frames, dim=0))
    caps = end_caps(theta, unpack_state(structure, states.flatten(0, 1))).unflatten(0, (k, frames))
    seen = observe(structure, own, torch.as_tensor(window.run.t[window.frames]), caps).numpy().copy()
    seen[..., 2] += up[:, None, None]
    return np.asarray(seen)

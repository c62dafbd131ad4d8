"""Which ramps tell of their winch: those in which the cable stayed taut, so that its length is what was wound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.diagnose.parity.winch import Ramps, wound

SLOWEST, FASTEST = 0.5, 1.6
"""Rates of taut ramps, over the nominal: a cable that is paid out slack shortens the robot by nothing."""
MIDDLE_S = 0.15
"""[s] at both ends of a ramp that latency, lag and play own: the middle alone is to be straight."""
BENT = 2.0
"""A middle that scatters about its line more than so many times the best quarter of all ramps is not straight."""


def taut(data: Ramps, speed: float) -> np.ndarray:
    """(ramp,) bool. speed: nominal, of the winches at full command [m/s].

    A ramp in whose middle the length does not follow the winch is left out, and so are those of the same cable after
    one that was paid out slack, up to and with the one that reels the slack in.
    """
    count = len(data)
    path = wound(data, {}, speed)
    rate, scatter = np.full(count, np.nan), np.full(count, np.nan)
    for k in range(count):
        rows = np.flatnonzero(data.ramp == k)
        x, y = path[rows], data.length[rows]
        # Inside: the winch has turned for a while already, and turns still.
        turned = np.abs(x - x[0])
        inside = (turned > MIDDLE_S) & (turned < turned.max() - MIDDLE_S / 3)
        if inside.sum() < 4:
            continue
        a, b = np.polyfit(x[inside], y[inside], 1)
        rate[k] = -a / speed
        scatter[k] = float(np.sqrt(np.mean((y[inside] - a * x[inside] - b) ** 2) * inside.sum() / (inside.sum() - 2)))
    straight = scatter <= BENT * np.nanquantile(scatter, 0.25) if np.isfinite(scatter).any() else np.zeros(count, bool)
    good: np.ndarray = (rate > SLOWEST) & (rate < FASTEST) & straight
    slack: dict[tuple[int, int], bool] = {}
    for k in np.lexsort((_start(data), data.cable, data.run)):
        key = (int(data.run[k]), int(data.cable[k]))
        was, own = slack.get(key, False), bool(good[k])
        slack[key] = not own if data.way[k] < 0 or not own else False
        if was:
            good[k] = False
    return good


def only(data: Ramps, kept: np.ndarray) -> Ramps:
    """The ramps of a mask (ramp,)."""
    number = np.cumsum(kept) - 1
    rows = kept[data.ramp]
    return replace(
        data, length=data.length[rows], t=data.t[rows], ramp=number[data.ramp[rows]], cable=data.cable[kept],
        way=data.way[kept], run=data.run[kept],
    )  # fmt: skip


def _start(data: Ramps) -> np.ndarray:
    """Of every ramp [s]."""
    first = np.searchsorted(data.ramp, np.arange(len(data)))
    return data.t[first]

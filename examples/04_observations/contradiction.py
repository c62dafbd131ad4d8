"""Contradicting gradients along one trajectory (the paper's fig. contradicted_gradient).

A car drives from A to B (100 m) and back at v; the true one has 1 m/s, is at B at 100 s, at A at 200 s, at B at 300 s.
A loss at each of the three targets, (x(t_i; v) - x_i)^2, pulls v its own way. Here x is the exact triangle wave with
its true derivative by v. Key Frame Loss compares the car with the truth drive by drive, each laid over from its start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
AB = 100.0
TARGETS = np.array([100.0, 200.0, 300.0])
"""When the true car reaches its targets [s]."""


def triangle(way: Array) -> tuple[Array, Array]:
    """Position [m] after driving `way` [m] to and fro, and its derivative by the way, +1 or -1."""
    phase = np.mod(way, 2 * AB)
    return np.where(phase <= AB, phase, 2 * AB - phase), np.where(phase < AB, 1.0, -1.0)


def pulls(v: Array, t: Array = TARGETS) -> Array:
    """-dloss_i/dv, shape (..., target): positive pulls the speed up, negative drags it down."""
    x, slope = triangle(v[..., None] * t)
    return -2 * (x - triangle(t)[0]) * slope * t


def key_frame_pulls(v: Array) -> Array:
    """-dloss_i/dv of the three drives under Key Frame Loss, shape (..., drive).

    A drive of the car and the true one are compared at the earlier of their ends, t = min(1, 1/v) 100 s.
    """
    t = np.minimum(AB, AB / v)
    return np.repeat((-2 * (v - 1) * t**2)[..., None], len(TARGETS), axis=-1)


def wrong_share(v: Array, steps: int = 300) -> Array:
    """Share of all steps of the trajectory whose loss pulls the speed away from 1 m/s, shape of v."""
    t = np.arange(1, steps + 1) * TARGETS[-1] / steps
    return np.mean(pulls(v, t) * (1 - v)[..., None] < 0, axis=-1)


def report() -> str:
    """Table of signs over the speed."""
    lines = ["pull of the losses at 100, 200, 300 s on the speed, and of the key frames; + faster, - slower"]
    lines.append("  v [m/s]   targets   key frames   steps that pull the wrong way")
    for v in np.round(np.arange(0.1, 2.01, 0.1), 1):
        if v == 1:
            continue
        signs, frames = (
            "".join("+" if p > 0 else "-" if p < 0 else "0" for p in found(np.array(v)))
            for found in (pulls, key_frame_pulls)
        )
        lines.append(f"  {v:7.1f}   {signs:7}   {frames:10}   {float(wrong_share(np.array(v))):.0%}")
    return "\n".join(lines) + "\n"

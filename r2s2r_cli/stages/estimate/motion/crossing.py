"""Rods do not go through each other."""

from __future__ import annotations

import itertools

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.factors import Frames

CROSSING_SD_M = 1e-3
"""[m] Of how far two rods may overlap."""


def add_crossings(frames: Frames, x: np.ndarray, body: Body) -> None:
    """One residual a pair of rods: by how much their axes are nearer than a diameter, 0 where they are not.

    The places of the nearest points along the rods are held fixed in the derivative: the distance is stationary in
    them. Only pairs whose nearest points lie inside both rods count (elsewhere the caps, which are thicker, are seen).
    """
    for i, j in itertools.combinations(range(len(body.rod)), 2):
        a, b, c, d = (x[:, body.p(cap)] for cap in (*body.rod[i], *body.rod[j]))
        s, t, inside = nearest(a, b - a, c, d - c)
        bar = c + t[:, None] * (d - c) - a - s[:, None] * (b - a)
        gap = np.linalg.norm(bar, axis=1)
        least = 0.5 * (body.rod_diameter[i] + body.rod_diameter[j])
        active = inside & (gap < least) & (gap > 1e-6)
        if not np.any(active):
            continue
        u = bar / np.maximum(gap, 1e-6)[:, None]
        slope = np.hstack([-(1 - s)[:, None] * u, -s[:, None] * u, (1 - t)[:, None] * u, t[:, None] * u])
        states = np.concatenate([body.p(cap) for cap in (*body.rod[i], *body.rod[j])])
        frames.scalar(states, slope, np.where(active, gap - least, 0.0), np.where(active, CROSSING_SD_M**-2, 0.0))


def nearest(a: np.ndarray, u: np.ndarray, c: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shares s, t along the lines a + s u and c + t w where they are nearest, and whether both lie inside 0 .. 1.

    All of shape (frame, 3); parallel lines count as not inside.
    """
    uu, ww, uw = (np.sum(p * q, axis=1) for p, q in ((u, u), (w, w), (u, w)))
    r = c - a
    ur, wr = np.sum(u * r, axis=1), np.sum(w * r, axis=1)
    det = uu * ww - uw**2
    safe = np.maximum(det, 1e-12)
    s, t = (ww * ur - uw * wr) / safe, (uw * ur - uu * wr) / safe
    inside = (det > 1e-9) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    return s, t, inside

"""How much of each pixel is the cap: a share 0 .. 1 from its chroma, so that half of it is the rim whatever lies beside.

A mask of saturation is not enough at the rim: pixels that mix cap and surroundings, from motion and from cameras that store colour
coarser than brightness (JPEG), are saturated beside a dark rod and pale beside a bright floor, which moves the mask by a
pixel. Chroma along the cap's own hue mixes linearly.
"""

from __future__ import annotations

import numpy as np

INNER = 0.8
"""Share of the disc's radius within which a pixel is all cap."""
LEAST = 12
"""Pixels of it that are needed."""
SHADE_LEAST = 0.7
"""The rim is not darker than this share of the darkest tenth of the inside."""
STEEPER = 2.0
"""Shares are stretched about one half: a shade that is not quite as modelled then counts as all or nothing."""
MIXED_PX = 1.0
"""A pixel that is half cap has its colour from so far inside of the rim on average."""
_RIDGE = 1e-3


def shares(color: np.ndarray, inside: np.ndarray, a: np.ndarray, b: np.ndarray, rim_px: float) -> np.ndarray | None:
    """Share of the cap in every pixel (v, u); None where too little of its inside is seen to know its colour.

    color: RGB (v, u, 3). inside: pixels of the cap's colour within INNER of its disc, bool (v, u). a, b: place of the pixels on the disc,
    in its radii, (v, u).

    Chroma is the part of a colour across grey, along that of the cap. Its shade over the ball is that of a dull surface, linear in the
    normal (a, b, -sqrt(1 - a^2 - b^2)), and never below what is turned away from the light.
    """
    rgb = color[inside].astype(float)
    if len(rgb) < LEAST:
        return None
    hue = rgb.mean(axis=0)
    hue -= hue.mean()
    size = float(hue @ hue)
    if size < 1.0:
        return None
    chroma = color.astype(float) @ (hue / size)
    seen = chroma[inside]
    bulge = np.sqrt(np.maximum(1.0 - a * a - b * b, 0.0))
    G = np.stack([np.ones_like(seen), a[inside], b[inside], bulge[inside]], axis=-1)
    shade = np.linalg.solve(G.T @ G + _RIDGE * len(seen) * np.eye(4), G.T @ seen)
    # What is mixed into a pixel of the rim lies a little inside of it.
    pull = np.minimum(1.0, (1.0 - MIXED_PX / rim_px) / np.maximum(np.hypot(a, b), 1e-6))
    a, b = pull * a, pull * b
    model = shade[0] + shade[1] * a + shade[2] * b + shade[3] * np.sqrt(1.0 - a * a - b * b)
    darkest = np.partition(seen, len(seen) // 10)[len(seen) // 10]
    share = chroma / np.maximum(model, SHADE_LEAST * darkest)
    return np.asarray(np.clip(0.5 + STEEPER * (share - 0.5), 0.0, 1.0))

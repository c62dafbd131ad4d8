"""How much of each pixel is the cap: a share 0 .. 1 from its chroma, one half at the rim whatever lies beside.

A mask of saturation is not enough there. Pixels that mix cap and surroundings, from motion and from pictures that store
colour coarser than brightness (JPEG), are saturated beside a dark rod and pale beside a bright floor: the mask moves by
a pixel. Chroma along the cap's own hue mixes linearly.
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
"""A pixel that is half cap has the cap's part of its colour from so far inside of the rim on average."""
BESIDE_PX = 2.0
"""And the rest of it from what is to be seen so far outside."""
BESIDE_MOST = 0.3
"""What lies beside has no more than this share of the cap's chroma; else it is of its colour and tells nothing."""
_RIDGE = 1e-3


def shares(color: np.ndarray, inside: np.ndarray, a: np.ndarray, b: np.ndarray, rim_px: float) -> np.ndarray | None:
    """Share of the cap in every pixel (v, u); None where too little of its inside is seen to know its colour.

    color: RGB (v, u, 3). inside: pixels of the cap's colour within INNER of its disc, bool (v, u). a, b: place of the
    pixels on the disc, in its radii, along u and v, (v, u). rim_px: radius of the disc.

    Chroma is the part of a colour across grey, along that of the cap. Its shade over the ball is that of a dull
    surface, linear in the normal (a, b, -sqrt(1 - a^2 - b^2)), and never below what is turned away from the light.
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
    x, y = a[inside], b[inside]
    G = np.stack([np.ones_like(seen), x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))], axis=-1)
    shade = np.linalg.solve(G.T @ G + _RIDGE * len(seen) * np.eye(4), G.T @ seen)
    rho = np.maximum(np.hypot(a, b), 1e-6)
    pull = np.minimum(1.0, (1.0 - MIXED_PX / rim_px) / rho)
    x, y = pull * a, pull * b
    darkest = np.partition(seen, len(seen) // 10)[len(seen) // 10]
    cap = np.maximum(shade[0] + shade[1] * x + shade[2] * y + shade[3] * np.sqrt(1.0 - x * x - y * y),
                     SHADE_LEAST * darkest)  # fmt: skip
    push = np.maximum(1.0 + BESIDE_PX / rim_px - rho, 0.0) * rim_px / rho
    v, u = np.indices(chroma.shape, sparse=True)
    v = np.clip(np.rint(v + push * b).astype(np.intp), 0, chroma.shape[0] - 1)
    u = np.clip(np.rint(u + push * a).astype(np.intp), 0, chroma.shape[1] - 1)
    beside = np.minimum(chroma[v, u], BESIDE_MOST * cap)
    share = (chroma - beside) / (cap - beside)
    return np.asarray(np.clip(0.5 + STEEPER * (share - 0.5), 0.0, 1.0))

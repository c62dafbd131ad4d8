"""The contact probe over the floor: is it the place, the cap, or the phase of the gait that grips otherwise?"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.where.channels import Spread, sizes
from r2s2r_cli.stages.diagnose.where.columns import Design
from r2s2r_cli.stages.diagnose.where.found import PlaceMap
from r2s2r_cli.stages.diagnose.which.arena import Arena

WIDTH_M = 0.06
"""Of the kernel: a patch is felt by a cap as wide as 35 mm that slides some centimetres in an interval."""
CELL_M = 0.02
TOUCHES_M = 0.012
"""A cap whose lowest point is simulated nearer to the ground touches it."""


def place_map(arena: Arena, design: Design) -> PlaceMap | None:
    """None where no interval says anything of friction."""
    places = np.array([k for k, one in enumerate(design.columns) if one.probe == "grip"], dtype=int)
    wide = Spread(np.zeros(design.q), np.zeros(len(places)), np.full(len(places), 1.0))
    c, sd = sizes(design, places, wide)
    scale = design.columns[places[0]].scale
    weight = np.clip(1.0 / sd**2 - 1.0 / scale**2, 0.0, None)
    where = _touched(arena, design)
    # What the interval itself says, without the prior's pull to 0.
    own = np.where(weight > 1e-6, c / (np.maximum(weight, 1e-6) * sd**2), 0.0)
    good = np.isfinite(where).all(axis=-1) & (weight > 0.05 / scale**2)
    if good.sum() < 6:
        return None
    stretch, cap = np.nonzero(good)
    xy, value, w = where[good], np.clip(own[good], -1.0, 2.0), np.minimum(weight[good], 25.0 / scale**2)
    interval = np.array([one.interval for one in arena.many])[stretch]
    gait = design.gait[stretch]
    r2 = {
        "place": _left_out(value, w, gait, lambda a, b: _kernel(xy[a], xy[b])),
        "cap": _left_out(value, w, gait, lambda a, b: (cap[a][:, None] == cap[b][None, :]).astype(float)),
        "phase": _left_out(value, w, gait, lambda a, b: (interval[a][:, None] == interval[b][None, :]).astype(float)),
    }
    low, high = xy.min(axis=0) - WIDTH_M / 2, xy.max(axis=0) + WIDTH_M / 2
    x, y = (np.arange(a, b + CELL_M, CELL_M) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    near = _kernel(grid, xy) * w
    mass = near.sum(axis=1)
    usual = float(w @ value / w.sum())
    smooth = near @ (value - usual) / (mass + 1.0 / scale**2)
    best = int(np.argmax(np.abs(smooth)))
    shape = (len(y), len(x))
    return PlaceMap(x, y, smooth.reshape(shape), mass.reshape(shape), r2, (float(grid[best, 0]), float(grid[best, 1])))


def _touched(arena: Arena, design: Design) -> np.ndarray:
    """Where each cap touched the ground in each stretch, on average over its slip, (stretch, cap, 2) [m]."""
    robot = arena.model.robot
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    found = np.full((len(design.caps), len(radius), 2), np.nan)
    for k, caps in enumerate(design.caps):
        seen = arena.many[k].caps
        slip = (
            np.linalg.norm(np.gradient(caps[..., :2], axis=0), axis=-1) if len(caps) > 1 else np.zeros(caps.shape[:2])
        )
        low = caps[..., 2] - radius < TOUCHES_M
        weight = np.where(low, slip + 1e-4, 0.0)
        total = weight.sum(axis=0)
        mean = np.einsum("fc,fci->ci", weight, np.nan_to_num(seen[..., :2])) / np.maximum(total, 1e-12)[:, None]
        found[k] = np.where((low.mean(axis=0) > 0.2)[:, None], mean, np.nan)
    return found


def _kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * np.sum((a[:, None] - b[None]) ** 2, axis=-1) / WIDTH_M**2))


def _left_out(value: np.ndarray, w: np.ndarray, gait: np.ndarray, alike: object) -> float:
    """Share of the weighted squares that points which are alike predict, in gaits that were left out."""
    left, total = 0.0, 0.0
    pull = float(np.median(w))
    for one in np.unique(gait):
        out, train = np.flatnonzero(gait == one), np.flatnonzero(gait != one)
        if not len(train):
            train = out
        usual = float(w[train] @ value[train] / w[train].sum())
        K = alike(out, train) * w[train]  # type: ignore[operator]
        guess = usual + K @ (value[train] - usual) / (K.sum(axis=1) + pull)
        left += float(w[out] @ (value[out] - guess) ** 2)
        total += float(w[out] @ (value[out] - usual) ** 2)
    return 1.0 - left / total if total > 0 else 0.0

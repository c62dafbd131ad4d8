"""Directions and amounts in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.identify.free.base import Coordinate, Free

MENTIONED = 0.2
"""Parameters whose part of a direction is below this share of the largest are left out of its words."""
MOST = 4


def amount(free: Free, z: float, dz: float) -> str:
    """Size of a change dz of the coordinate at z: `10 %` in a log coordinate (a factor if large), else in the unit."""
    if free.coordinate is Coordinate.LOG:
        factor = math.exp(min(abs(dz), 700.0))
        return f"{100 * (factor - 1.0):.2g} %" if factor < 2.0 else f"a factor {factor:.2g}"
    change = abs(free.from_z(z + dz) - free.from_z(z))
    return f"{change:.2g}" + ("" if free.unit == "1" else f" {free.unit}")


def shrunk(free: Free, width: float, share: float) -> str:
    """What the runs made of what was thought possible. width: of prior and bounds, in z; share: of it that is left."""
    possible = amount(free, free.to_z(free.start), width)
    left = "all of it" if share >= 0.995 else f"{share:.2g} of it"
    return f"prior and bounds allow {possible}, the runs leave {left}"


def direction(
    frees: Sequence[Free], z: np.ndarray, dz: np.ndarray, size: np.ndarray, seen: float, *, weak: bool
) -> str:
    """A step dz (p,) from z in words. size: |dz| in widths, which decides who is mentioned; seen: length of the change
    of all residuals, in standard deviations; weak: that is too little."""
    order = [int(i) for i in np.argsort(-size) if size[i] >= MENTIONED * size.max()][:MOST]
    parts = [
        f"{'raising' if dz[i] > 0 else 'lowering'} {frees[i].name} by {amount(frees[i], float(z[i]), float(dz[i]))}"
        for i in order
    ]
    changes = f"changes all residuals by {'only ' * weak}{seen:.2g} sd" if seen > 0 else "changes no residual"
    if len(parts) == 1:
        return f"{parts[0]} {changes}" + ": the data hardly depend on it" * weak
    together = f"{', '.join(parts[:-1])} and {parts[-1]} together {changes}"
    return together + ": the data cannot tell them apart" * weak

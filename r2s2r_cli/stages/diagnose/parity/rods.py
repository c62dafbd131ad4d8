"""Lengths that never change: the two caps of every rod, as the camera sees them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.parity.series import Measured, Series, combined, persistence
from schemas.robot import Robot


def rod_scales(runs: Sequence[Series], robot: Robot) -> list[Measured]:
    """Seen length over that of robot.toml, of every rod [1]."""
    found: list[list[Measured]] = [[] for _ in robot.rods]
    for one in runs:
        for k, rod in enumerate(robot.rods):
            apart = np.linalg.norm(one.p_WE[:, 2 * k + 1] - one.p_WE[:, 2 * k], axis=-1)
            apart = apart[np.isfinite(apart)]
            if len(apart) < 5:
                continue
            # Noise across the rod lengthens it, on two axes.
            own = apart - (one.noise[2 * k] ** 2 + one.noise[2 * k + 1] ** 2) / apart
            middle = float(np.median(own))
            rest = own - middle
            spread = 1.4826 * float(np.median(np.abs(rest)))
            rows = len(own) / persistence(rest, np.zeros(len(own)))
            found[k].append(Measured(middle / rod.length_m, max(1.2533 * spread / np.sqrt(rows), 1e-6) / rod.length_m))
    return [combined(parts) for parts in found]


def lost(runs: Sequence[Series]) -> Measured:
    """Share of the frames and caps that were not seen, were outliers, or never came (gaps of twice the usual)."""
    missing, all_of = 0.0, 0.0
    for one in runs:
        unseen = ~np.isfinite(one.p_WE).all(axis=-1)
        gap = np.diff(one.t)
        usual = float(np.median(gap)) if len(gap) else 1.0
        never = float(np.sum(np.maximum(np.round(gap / usual) - 1, 0)))
        missing += unseen.mean(axis=1).sum() + never
        all_of += len(one.t) + never
    if not all_of:
        return Measured(float("nan"), float("nan"))
    share = missing / all_of
    return Measured(share, float(np.sqrt(max(share * (1 - share), 1.0 / all_of) / all_of)))

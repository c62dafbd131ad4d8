"""What goes wrong and stands in no catalogue, drawn at a size; the laws are in `outside_laws`.

A diagnoser that is honest answers `unknown` to each of them.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.blind.make.outside_laws import Bending, Bump, Cogging, CrossTalk, Magnet, Push, Snag, Sway

Outside = Cogging | Snag | Push | Bump | Bending | CrossTalk | Magnet | Sway


def outside(name: str, rng: np.random.Generator, s: float) -> Outside:
    """One of OUTSIDE at size s, 1 usual. Raises KeyError for another name."""
    a = rng.uniform(0, 2 * np.pi)
    way = (float(np.cos(a)), float(np.sin(a)))
    far = float(rng.uniform(0.03, 0.15))
    begin = float(rng.uniform(2.0, 6.0))
    if name == "motor_cogging":
        return Cogging(min(0.5 * s, 0.9), float(rng.uniform(1.5, 4.0)))
    if name == "cable_snag":
        return Snag(int(rng.integers(6)), begin, begin + 0.6 * s)
    if name == "lateral_push":
        return Push(int(rng.integers(3)), (1.5 * s * way[0], 1.5 * s * way[1], 0.0), begin, begin + 0.5)
    if name == "floor_bump":
        return Bump((far * way[0], far * way[1]), 0.04, 0.012 * s)
    if name == "rod_bending":
        return Bending(0.0004 * s)
    if name == "sensor_crosstalk":
        return CrossTalk(0.15 * s)
    if name == "magnetic_pull":
        return Magnet((far * way[0], far * way[1]), 0.6 * s, 0.08)
    if name == "gravity_sway":
        return Sway(float(np.deg2rad(4.0)) * s, float(rng.uniform(3.0, 9.0)), way)
    raise KeyError(name)


OUTSIDE = (
    "motor_cogging", "cable_snag", "lateral_push", "floor_bump", "rod_bending", "sensor_crosstalk", "magnetic_pull",
    "gravity_sway",
)  # fmt: skip
"""Names of all of them."""

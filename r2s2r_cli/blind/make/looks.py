"""How target intervals look: as recorded, or simulated again in another world, from their starts or pushed ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.blind.make.body import body_of
from r2s2r_cli.blind.make.drive import Driven
from r2s2r_cli.blind.make.observe import through
from r2s2r_cli.blind.make.worlds import DAY_SD_M, Hidden
from schemas.robot import Robot

LOOK_S = 0.1
"""Between two instants that are compared."""
LENGTH_FLOOR_M = 0.0015
"""Of a sensor: what its lag makes of a moving cable [m]."""
PUSH_M_PER_S, PUSH_RAD_PER_S, PUSHED_M = 0.02, 0.1, 0.001
"""Sd of the least push in every coordinate of a rod, and what it comes to: cables stop it within a twentieth of a
second, a millimetre or a third of a degree away."""
START_SHARE = 0.4
"""Of the camera's noise, to which a start pose is known: errors that stay over an interval are 0.3 of it, and some
frames before the start leave as much of the rest."""
LET_OUT_M = float(np.hypot(LENGTH_FLOOR_M, DAY_SD_M))
"""Of every winch at a start: what its sensor does not tell. It decides when a robot that is about to fall does."""


@dataclass(frozen=True)
class Looks:
    """Of one interval, every LOOK_S: t [s], (look,); p: end caps as placed [m], (look, cap, 3); length [m], (look,
    cable)."""

    t: np.ndarray
    p: np.ndarray
    length: np.ndarray


def recorded(hidden: Hidden, run: Driven, gait: int, later: float = 0.0) -> list[Looks]:
    """What really happened, seen by the camera of that world without noise. later: by a clock so far off [s]."""
    camera = hidden.world(gait, run.gait.position, run.gait.heading).seen()
    late = camera.clock.stamp_delay_s
    found = []
    for t in _times(run):
        at = _between(t - late + later, run.t, run.caps)
        found.append(Looks(t, through(camera, t - late, at), _between(t + later, run.t, run.sensed)))
    return found


def replayed(
    robot: Robot, hidden: Hidden, run: Driven, gait: int, pushes: np.random.Generator | None = None,
    size: float | None = None,
) -> list[Looks]:  # fmt: skip
    """Every interval of a run in another world, from its true start under its duties. pushes: draws what a start is
    pushed by; size: in units of the least push; None: as well as the camera's noise tells a start."""
    body = body_of(robot, hidden, gait, run.gait.position, run.gait.heading)
    world = hidden.world(gait, run.gait.position, run.gait.heading)
    camera, late = world.seen(), world.seen().clock.stamp_delay_s
    found = []
    for t, moment, first in zip(_times(run), run.moments, run.starts, strict=True):
        body.restore(moment)
        if pushes is not None:
            rods = run.caps.shape[1] // 2
            by, let_out = (size, size) if size is not None else (max(1.0, START_SHARE * hidden.noise_m / PUSHED_M), 1.0)
            body.push(by * PUSH_M_PER_S * pushes.standard_normal((rods, 3)),
                      by * PUSH_RAD_PER_S * pushes.standard_normal((rods, 3)),
                      let_out * LET_OUT_M * pushes.standard_normal(len(robot.actuated)))  # fmt: skip
        k, now = int(first), float(run.t[first])
        p, length = [], []
        for due in t:
            while k < len(run.t) and run.t[k] <= due + 1e-9:
                body.advance(float(run.t[k]) - now, run.duty[k - 1] if k > first else run.duty[k])
                now = float(run.t[k])
                k += 1
            body.advance(float(due) - now, run.duty[k - 1])
            now = float(due)
            p.append(body.caps())
            length.append(body.sensed())
        caps = _between(np.maximum(t - late, t[0]), t, np.array(p))
        found.append(Looks(t, through(camera, t - late, caps), np.array(length)))
    return found


def _times(run: Driven) -> list[np.ndarray]:
    """Instants that are compared, by interval: from its start, every LOOK_S, and its end [s]."""
    ends = [*run.t[run.starts[1:]], run.t[-1]]
    return [np.append(np.arange(a, b - LOOK_S / 2, LOOK_S), b) for a, b in zip(run.t[run.starts], ends, strict=True)]


def _between(t: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (known, ...) at times t by straight lines, constant beyond the ends."""
    flat = values.reshape(len(known), -1)
    return np.stack([np.interp(t, known, column) for column in flat.T], axis=-1).reshape(len(t), *values.shape[1:])

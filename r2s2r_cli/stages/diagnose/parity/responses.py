"""How the winched cables answer to the commands: every command against the rate of every cable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.mismatch_words import LEAST_ROWS
from r2s2r_cli.stages.diagnose.parity.series import Series
from r2s2r_cli.stages.diagnose.sensor_noise import noise_of
from r2s2r_cli.stages.identify.commands import CommandLog
from schemas.robot import Robot

SPAN_S = 0.1
"""[s] over which a rate is taken."""


@dataclass(frozen=True)
class Responses:
    """Of all winched cables. correlation: about zero, of every command with the shortening of every cable, (cable,
    command); own: of each with its own command, had its readings no noise, (cable,). rate: RMS [m/s], less what noise
    makes of it, (cable,); command: RMS of its shares of full speed [1], (cable,)."""

    correlation: np.ndarray
    own: np.ndarray
    rate: np.ndarray
    command: np.ndarray


def responses(runs: Sequence[Series], robot: Robot, *, lag: float = 0.0) -> Responses | None:
    """Of all runs together; None where there is too little to tell from. lag [s]: by which cables may answer late."""
    n = len(robot.actuated)
    products, u2, v2, noise2 = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    rows = np.zeros(n, dtype=int)
    for one in runs:
        log = CommandLog(one.run.caps)
        for i, cable in enumerate(robot.actuated):
            t, length = readings(one, cable)
            span = max(1, round(SPAN_S / max(float(np.median(np.diff(t))), 1e-3))) if len(t) > 2 else 1
            if len(t) <= span + LEAST_ROWS:
                continue
            past = t[span:] - t[:-span]
            whole = past > 0
            v = -(length[span:] - length[:-span])[whole] / past[whole]
            u = log.at(((t[span:] + t[:-span]) / 2)[whole] - lag)
            products[i] += v @ u
            u2[i] += (u**2).sum(axis=0)
            v2[i] += v @ v
            noise2[i] += float(np.sum(2.0 * noise_of(length[:, None])[0] ** 2 / past[whole] ** 2))
            rows[i] += len(v)
    if rows.min() < LEAST_ROWS or not (u2 > 0).all():
        return None
    moved2 = np.maximum(v2 - noise2, 0.0)
    told2 = np.diag(u2)
    return Responses(
        np.asarray(products / np.sqrt(np.maximum(u2 * v2[:, None], 1e-30))),
        np.asarray(np.diag(products) / np.sqrt(np.maximum(told2 * moved2, 1e-30))),
        np.sqrt(moved2 / rows),
        np.sqrt(told2 / rows),
    )


def readings(one: Series, cable: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of the readings of a cable and what they were [m], (row,): of its sensor, else of the caps. Each sensor has
    times of its own: boards of wireless robots take turns, so a row of the log has the cables of one board."""
    t, length = one.heard if one.has_sensors else (one.t, one.seen)
    good = np.isfinite(length[:, cable])
    return t[good], length[good, cable]

"""Commands that belong to another run or another clock: the winches turn, and not when they are told to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Mismatch
from r2s2r_cli.stages.diagnose.parity.responses import responses
from r2s2r_cli.stages.diagnose.parity.series import Series
from schemas.robot import Robot

LATE_S = np.arange(0.0, 0.51, 0.05)
"""[s] Cables may answer so late: a slow link or motor is an effect."""
FOLLOWS = 0.5
"""Mean correlation of commands with the rates of their cables from which they belong together: in 110 calibration sets
with effects of every kind it is 0.63 to 0.98, with commands exchanged between the target intervals 0.39 at most."""
TURNS = 0.5
"""Of the commanded rate, RMS: winches that hardly turn follow no command either, and have no wrong log."""


def of_another_run(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Commands and cable lengths that have nothing to do with each other although the cables move as much as the
    commands ask for. speed: nominal, of the winches [m/s]. Only sensors are steady enough to tell."""
    heard = [one for one in runs if one.has_sensors]
    if not heard:
        missing.append("whether the commands belong to the motion: no cable lengths were logged")
        return []
    now = responses(heard, robot)
    if now is None or now.rate < TURNS * speed * now.command:
        return []
    every = [responses(heard, robot, lag=float(lag)) for lag in LATE_S]
    best = max(float(np.diag(one.correlation).mean()) for one in every if one is not None)
    if best >= FOLLOWS:
        return []
    return [Mismatch(
        "commands", "the winches turn, but not when the commands say so", f"correlation of {FOLLOWS:g} or more",
        f"{best:.2f}, the cables up to {LATE_S[-1]:g} s late",
        "r2s2r import run.csv   # with commands and lengths of the same run, on one clock",
    )]  # fmt: skip

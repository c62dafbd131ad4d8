"""Commands that belong to another run or another clock: the winches turn, and not when they are told to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Mismatch
from r2s2r_cli.stages.diagnose.parity.responses import responses
from r2s2r_cli.stages.diagnose.parity.series import Series
from schemas.robot import Robot

LATE_S = np.arange(0.05, 0.51, 0.05)
"""[s] Cables may answer so late, or at once: a slow link or motor is an effect."""
FOLLOWS = 0.5
"""Mean correlation of commands with the rates of their cables from which they belong together: in 107 calibration sets
with effects of every kind it is 0.65 or more, with commands exchanged between target intervals 0.40 at most (three
times each; in three more sets no winch turns)."""
TURNS = 0.5
"""Of the commanded rate, RMS: a winch that hardly turns follows no command either, and has no wrong log."""
LEAST = 2
"""Winches that turn."""


def of_another_run(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Commands and cable lengths that have nothing to do with each other although cables move as much as the commands
    ask for. speed: nominal, of the winches [m/s]. Only sensors are steady enough to tell."""
    heard = [one for one in runs if one.has_sensors]
    now = responses(heard, robot) if heard else None
    if now is None:
        missing.append("whether the commands belong to the motion: too few cable lengths were logged")
        return []
    turn = now.rate >= TURNS * speed * now.command
    if turn.sum() < LEAST:
        return []
    best = float(now.own[turn].mean())
    for lag in LATE_S:
        if best >= FOLLOWS:  # as at once in nearly all logs: the other delays need not be tried
            break
        late = responses(heard, robot, lag=float(lag))
        best = best if late is None else max(best, float(late.own[turn].mean()))
    if best >= FOLLOWS:
        return []
    return [Mismatch(
        "commands", "the winches turn, but not when the commands say so", f"correlation of {FOLLOWS:g} or more",
        f"{best:.2f}, the cables up to {LATE_S[-1]:g} s late",
        "r2s2r import run.csv   # with commands and lengths of the same run, on one clock",
    )]  # fmt: skip

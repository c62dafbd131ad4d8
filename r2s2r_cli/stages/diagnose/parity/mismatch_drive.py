"""Commands that move another cable, the wrong way, or at a wrong speed: what the winches answer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Mismatch
from r2s2r_cli.stages.diagnose.parity.mismatch_commands import FOLLOWS
from r2s2r_cli.stages.diagnose.parity.mismatch_words import LEAST_ROWS, columns, listed
from r2s2r_cli.stages.diagnose.parity.responses import readings, responses
from r2s2r_cli.stages.diagnose.parity.series import GAP_S, Series
from r2s2r_cli.stages.identify.commands import CommandLog
from schemas.robot import Robot

SURE = 0.5
"""Correlation of a command with the rate of its cable that leaves no doubt of its sign."""
CLEARER = 0.35
"""By how much commands must follow other cables better than their own, in correlation."""
FAST, SLOW = 1.6, 0.6
"""Winding rates over the nominal, all winches alike, that are a wrong number and no effect."""
STANDS = 0.05
"""Of the nominal rate: a winch that does not turn has no wrong number, it does not start."""
WAYS = (1.0, -1.0)
"""Reeling in, paying out, as commands are signed."""
TURNS = 0.3
"""Of the nominal rate: the others turn, so power and commands are there."""


def order_of_motors(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Exchanged motors: the command of one moves the cable of another."""
    del speed
    response = responses(runs, robot)
    if response is None:
        missing.append("order and sign of the motors: too few commands")
        return []
    from scipy.optimize import linear_sum_assignment

    size = np.abs(response.correlation)
    row, column = linear_sum_assignment(-size)
    moved = [k for k in range(len(row)) if column[k] != k]
    if not moved or np.mean([size[k, column[k]] - size[k, k] for k in moved]) < CLEARER:
        return []
    if size[row, column].mean() < FOLLOWS:  # no order makes the cables follow
        return []
    order = {robot.actuated[k]: robot.actuated[int(column[k])] for k in moved}
    return [columns("motors", order, "the rates of the cables")]


def signs(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Motors that lengthen their cable where the log says that they shorten it."""
    del speed, missing
    response = responses(runs, robot)
    if response is None:
        return []
    own = np.diag(response.correlation)
    every = bool(np.median(own) < -SURE)
    wrong = [robot.actuated[k] for k in range(len(own)) if every or own[k] < -SURE]
    if not wrong:
        return []
    who = "all motors" if every else f"motor{'s' * (len(wrong) > 1)} {listed(wrong)}"
    return [Mismatch(
        "sign", f"{who} wind{'s' if len(wrong) == 1 else ''} the wrong way: +1 lengthens the cable", "+1 shortens it",
        f"correlation {own.min():.2f}",
        "r2s2r import run.csv   # with these control columns negated, or sign = -1 of the motors in robot.toml",
    )]  # fmt: skip


def standing(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Single motors that turn neither way at full command while others do: a plug, a cable off its winch. Where all
    stand there may be a law behind it (a dead zone), which is for the catalogue to name."""
    del missing
    rates = _full_rates(runs, robot)
    turned = {k: np.abs(list(both.values())) / speed for k, both in rates.items() if len(both) == 2}
    still = [k for k, share in turned.items() if share.max() < STANDS]
    if not still or len(still) == len(turned) or np.median([share.min() for share in turned.values()]) < TURNS:
        return []
    who = f"motor{'s' * (len(still) > 1)} {listed(robot.actuated[k] for k in still)}"
    most = max(turned[k].max() for k in still)
    return [Mismatch(
        "motor", f"{who} {'do' if len(still) > 1 else 'does'} not turn at full command, either way",
        f"{1e3 * speed:.0f} mm/s", f"{1e3 * most * speed:.1f} mm/s at most",
        "r2s2r doctor   # then the plug of the motor and its winch; leave these runs out",
    )]  # fmt: skip


def rate(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """All winches much too fast or slow both ways: a wrong speed, radius or clock."""
    rates = [one for both in _full_rates(runs, robot).values() for one in both.values()]
    if len(rates) < 4:
        missing.append("rate of the winches: too few long commands at full speed")
        return []
    ratio = float(np.median(rates)) / speed
    if SLOW < ratio < FAST or ratio < STANDS:
        return []
    return [Mismatch(
        "rate", f"all winches run at {ratio:.2g} times their nominal speed", f"{1e3 * speed:.0f} mm/s",
        f"{1e3 * ratio * speed:.0f} mm/s",
        "r2s2r identify   # or correct speed and winch_radius_m in robot.toml, or the stamps of the log",
    )]  # fmt: skip


def _full_rates(runs: Sequence[Series], robot: Robot) -> dict[int, dict[float, float]]:
    """Winding rate of each winch at full command, way (+1: reeling in) by way, where there is enough of it [m/s]; +: as
    it was told. Runs are taken together."""
    logs = [(one, CommandLog(one.run.caps)) for one in runs]
    found: dict[int, dict[float, float]] = {}
    for k, cable in enumerate(robot.actuated):
        moved, took, rows = dict.fromkeys(WAYS, 0.0), dict.fromkeys(WAYS, 0.0), dict.fromkeys(WAYS, 0)
        for one, log in logs:
            t, length = readings(one, cable)
            u, past = log.at(t)[:, k], np.diff(t)
            for way in WAYS:
                inside = way * u > 0.9
                steady = inside[1:] & inside[:-1] & (past > 0) & (past < GAP_S)
                moved[way] += -way * float(np.diff(length)[steady].sum())
                took[way] += float(past[steady].sum())
                rows[way] += int(steady.sum())
        own = {way: moved[way] / took[way] for way in WAYS if rows[way] >= LEAST_ROWS}
        if own:
            found[k] = own
    return found

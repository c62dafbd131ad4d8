"""Caps and sensors whose columns are exchanged: another order explains rods and cable lengths far better."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Mismatch, cable_ends
from r2s2r_cli.stages.diagnose.parity.mismatch_words import LEAST_ROWS, columns, listed
from r2s2r_cli.stages.diagnose.parity.series import Series
from schemas.robot import Robot

PLAIN = 2.0
"""Another order must explain the data so many times better: effects do not come near that."""


def order_of_caps(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Exchanged caps: another order of them makes the rods as long as they are, or the sensors right."""
    del speed, missing
    n = robot.n_caps
    spread = np.zeros((n, n))
    rows = np.concatenate([one.p_WE for one in runs])
    for a in range(n):
        for b in range(n):
            apart = np.linalg.norm(rows[:, a] - rows[:, b], axis=-1)
            spread[a, b] = np.sqrt(np.nanmean((apart - robot.rods[0].length_m) ** 2))
    if len({rod.length_m for rod in robot.rods}) > 1:
        return []
    orders = _cap_orders(len(robot.rods))
    stiff = np.array([np.mean([spread[o[2 * k], o[2 * k + 1]] for k in range(len(robot.rods))]) for o in orders])
    heard = [one for one in runs if one.has_sensors]
    usual = max(float(np.mean([one.noise.mean() for one in runs])), 1e-3)
    best = int(np.argmin(stiff))
    if stiff[0] > PLAIN * max(stiff[best], usual) and stiff[best] < 0.1 * robot.rods[0].length_m:
        alike = [k for k in range(len(orders)) if stiff[k] < PLAIN * max(stiff[best], usual)]
        if heard:  # the rods do not say which rod is which, and which end is which
            best = min(alike, key=lambda k: _against_sensors(heard, robot, orders[k]))
        return [_order("caps", orders[best], "the distances of caps on a rod", 1e3 * stiff[0], 1e3 * stiff[best])]
    if not heard:
        return []
    alike = [k for k in range(len(orders)) if stiff[k] < PLAIN * max(stiff[0], usual)]
    misfit = np.array([_against_sensors(heard, robot, orders[k]) for k in alike])
    best = int(np.argmin(misfit))
    if misfit[0] > PLAIN * max(misfit[best], 2 * usual):
        return [_order("caps", orders[alike[best]], "cable lengths", 1e3 * misfit[0], 1e3 * misfit[best])]
    return []


def _cap_orders(rods: int) -> list[tuple[int, ...]]:
    """Orders in which caps may have been exchanged: any two, whole rods, ends of rods; as they are first."""
    same = tuple(range(2 * rods))
    found = [same]
    for rod_order in permutations(range(rods)):
        for flips in product((0, 1), repeat=rods):
            found.append(tuple(2 * r + (e ^ f) for r, f in zip(rod_order, flips, strict=True) for e in (0, 1)))
    for a in range(2 * rods):
        for b in range(a + 1, 2 * rods):
            swapped = list(same)
            swapped[a], swapped[b] = b, a
            found.append(tuple(swapped))
    return list(dict.fromkeys(found))


def _against_sensors(runs: Sequence[Series], robot: Robot, order: tuple[int, ...]) -> float:
    """RMS of sensor lengths against cap distances with the caps in another order [m]."""
    ends = np.array(order)[cable_ends(robot)]
    squares = [
        np.nanmedian((np.linalg.norm(one.p_WE[:, ends[:, 1]] - one.p_WE[:, ends[:, 0]], axis=-1) - one.sensed) ** 2, 0)
        for one in runs
    ]  # fmt: skip
    return float(np.sqrt(np.nanmean(squares)))


def order_of_sensors(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Exchanged sensors: what one reads is the distance of another cable's caps."""
    del speed
    heard = [one for one in runs if one.has_sensors]
    if not heard:
        missing.append("order of sensors: no cable lengths were logged")
        return []
    n = len(robot.cables)
    cost = np.full((n, n), np.nan)
    for s in range(n):
        for k in range(n):
            away = np.concatenate([one.sensed[:, s] - one.seen[:, k] for one in heard])
            if np.isfinite(away).sum() > LEAST_ROWS:
                cost[s, k] = np.sqrt(np.nanmedian(away**2))
    return _exchanged("sensors", cost, "the distances of the caps")


def _exchanged(what: str, cost: np.ndarray, by: str) -> list[Mismatch]:
    """Another assignment of rows to columns that costs much less than the diagonal; nan: not known, left alone."""
    from scipy.optimize import linear_sum_assignment

    known = np.flatnonzero(np.isfinite(np.diag(cost)))
    if len(known) < 2:
        return []
    part = np.nan_to_num(cost[np.ix_(known, known)], nan=1e9)
    row, column = linear_sum_assignment(part**2)
    moved = [k for k in range(len(row)) if row[k] != column[k]]
    if not moved:
        return []
    own = np.sqrt(np.mean([part[k, k] ** 2 for k in moved]))
    other = np.sqrt(np.mean([part[k, column[k]] ** 2 for k in moved]))
    if own < PLAIN * other:
        return []
    return [columns(what, {int(known[k]): int(known[column[k]]) for k in moved}, by)]


def _order(what: str, order: tuple[int, ...], by: str, own: float, other: float) -> Mismatch:
    moved = {k: a for k, a in enumerate(order) if k != a}
    return Mismatch(
        "order", f"{what} {listed(moved)} are exchanged", f"{by} as robot.toml has them",
        f"{own:.0f} mm off, {other:.0f} mm when exchanged",
        f"r2s2r import run.csv   # with the columns of {what} {listed(moved)} in their order",
    )  # fmt: skip

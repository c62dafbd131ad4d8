"""Settings that contradict the data, named before any physics: units, order of caps and cables, signs, rate, gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import permutations, product

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.finding import Mismatch, cable_ends
from r2s2r_cli.stages.diagnose.parity.series import Series, series
from r2s2r_cli.stages.identify.commands import CommandLog
from schemas.robot import Robot

UNITS = {1000.0: "millimetres", 100.0: "centimetres", 39.37: "inches", 0.001: "kilometres"}
NEAR = 0.15
"""Relative distance within which a ratio is that of a unit."""
PLAIN = 2.0
"""Another order must explain the data so many times better: effects do not come near that."""
SURE = 0.5
"""Correlation of a command with the rate of its cable that leaves no doubt of its sign."""
CLEARER = 0.35
"""By how much commands must follow other cables better than their own, in correlation."""
LEAST_ROWS = 20
FAST, SLOW = 1.6, 0.6
"""Winding rates over the nominal, all winches alike, that are a wrong number and no effect."""
WHOLE = 1.5
"""Commands beyond this are not in units of the largest."""


def mismatches(runs: Sequence[Run], robot: Robot, speed: float) -> tuple[list[Mismatch], list[str]]:
    """What is plainly set wrong, most basic first, and what could not be looked at. speed: nominal, of the winches
    [m/s].

    A wrong unit makes everything after it meaningless, and so does a wrong order: the search ends at the first stage
    with a mismatch.
    """
    many = tuple(series(run, robot) for run in runs)
    missing: list[str] = []
    stages: tuple[Callable[[Sequence[Series], Robot, float, list[str]], list[Mismatch]], ...] = (
        _units, _caps, _sensors, _cables, _signs, _rate,
    )  # fmt: skip
    for stage in stages:
        found = stage(many, robot, speed, missing)
        if found:
            return found, missing
    return [], missing


def _units(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    del speed, missing
    found = []
    rods = [
        np.nanmedian(np.linalg.norm(one.p_WE[:, 2 * k + 1] - one.p_WE[:, 2 * k], axis=-1)) / rod.length_m
        for one in runs for k, rod in enumerate(robot.rods)
    ]  # fmt: skip
    if unit := _unit(float(np.nanmedian(rods))):
        found.append(Mismatch(
            "unit", f"the end caps are in {unit}, not metres", f"rods of {robot.rods[0].length_m:g} m",
            f"{float(np.nanmedian(rods)) * robot.rods[0].length_m:g}", "r2s2r import run.csv   # columns cap0_x_mm ...",
        ))  # fmt: skip
        return found
    lengths = [np.nanmedian(one.sensed / one.seen) for one in runs if one.has_sensors]
    if lengths and (unit := _unit(float(np.nanmedian(lengths)))):
        found.append(Mismatch(
            "unit", f"the cable sensors read {unit}, not metres", "lengths like the distances of their caps",
            f"{float(np.nanmedian(lengths)):g} times those", "r2s2r import run.csv   # columns length0_mm ...",
        ))  # fmt: skip
    largest = max((float(np.nanmax(np.abs(one.run.caps.control))) for one in runs), default=0.0)
    if largest > WHOLE:
        found.append(Mismatch(
            "gain", f"motor commands go up to {largest:g}: they are not shares of the largest command", "-1 to 1",
            f"{largest:g}", "r2s2r import run.csv   # control divided by the largest command",
        ))  # fmt: skip
    return found


def _unit(ratio: float) -> str | None:
    return next((name for size, name in UNITS.items() if abs(ratio / size - 1) < NEAR), None)


def _caps(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
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


def _sensors(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
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


def _cables(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """Exchanged motors: the command of one moves the cable of another."""
    del speed
    response = _responses(runs, robot)
    if response is None:
        missing.append("order and sign of the motors: too few commands")
        return []
    from scipy.optimize import linear_sum_assignment

    size = np.abs(response)
    row, column = linear_sum_assignment(-size)
    moved = [k for k in range(len(row)) if column[k] != k]
    if not moved or np.mean([size[k, column[k]] - size[k, k] for k in moved]) < CLEARER:
        return []
    order = {robot.actuated[k]: robot.actuated[int(column[k])] for k in moved}
    return [_columns("motors", order, "the rates of the cables")]


def _signs(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    del speed, missing
    response = _responses(runs, robot)
    if response is None:
        return []
    own = np.diag(response)
    every = bool(np.median(own) < -SURE)
    wrong = [robot.actuated[k] for k in range(len(own)) if every or own[k] < -SURE]
    if not wrong:
        return []
    who = "all motors" if every else _list("motor", wrong)
    return [Mismatch(
        "sign", f"{who} wind{'s' if len(wrong) == 1 else ''} the wrong way: +1 lengthens the cable", "+1 shortens it",
        f"correlation {own.min():.2f}",
        "r2s2r import run.csv   # with these control columns negated, or sign = -1 of the motors in robot.toml",
    )]  # fmt: skip


def _rate(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    """All winches much too fast or slow both ways: a wrong speed, radius or clock."""
    rates: list[float] = []
    for one in runs:
        length, t = _best_lengths(one)
        log = CommandLog(one.run.caps)
        for k, cable in enumerate(robot.actuated):
            u = log.at(t)[:, k]
            for way in (1.0, -1.0):
                inside = way * u > 0.9
                steady = inside[1:] & inside[:-1]
                if steady.sum() >= LEAST_ROWS:
                    moved = -way * np.diff(length[:, cable])[steady]
                    rates.append(float(np.nansum(moved) / np.nansum(np.diff(t)[steady] * np.isfinite(moved))))
    if len(rates) < 4:
        missing.append("rate of the winches: too few long commands at full speed")
        return []
    ratio = float(np.median(rates)) / speed
    if SLOW < ratio < FAST:
        return []
    return [Mismatch(
        "rate", f"all winches run at {ratio:.2g} times their nominal speed", f"{1e3 * speed:.0f} mm/s",
        f"{1e3 * ratio * speed:.0f} mm/s",
        "r2s2r identify   # or correct speed and winch_radius_m in robot.toml, or the stamps of the log",
    )]  # fmt: skip


def _best_lengths(one: Series) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of all cables (row, cable) and their times: of sensors, else of caps."""
    if one.has_sensors:
        t, length = one.heard
        return length, t
    return one.seen, one.t


def _responses(runs: Sequence[Series], robot: Robot) -> np.ndarray | None:
    """Correlation about zero of every command with the shortening of every winched cable, (cable, command)."""
    n = len(robot.actuated)
    products, u2, v2 = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    rows = 0
    for one in runs:
        length, t = _best_lengths(one)
        span = max(1, round(0.1 / max(float(np.median(np.diff(t))), 1e-3))) if len(t) > 2 else 1
        if len(t) <= span + LEAST_ROWS:
            continue
        v = -(length[span:] - length[:-span])[:, list(robot.actuated)] / (t[span:] - t[:-span])[:, None]
        u = CommandLog(one.run.caps).at((t[span:] + t[:-span]) / 2)
        good = np.isfinite(v)
        v = np.where(good, v, 0.0)
        products += v.T @ u
        u2 += good.astype(float).T @ u**2
        v2 += (v**2).sum(axis=0)[:, None]
        rows += len(v)
    if rows < LEAST_ROWS or not (u2 > 0).all():
        return None
    return np.asarray(products / np.sqrt(np.maximum(u2 * v2, 1e-30)))


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
    return [_columns(what, {int(known[k]): int(known[column[k]]) for k in moved}, by)]


def _columns(what: str, order: dict[int, int], by: str) -> Mismatch:
    return Mismatch(
        "order", f"{what} {_cycle(order)} are exchanged", f"{what} that agree with {by} in their order",
        ", ".join(f"{a} is {b}" for a, b in order.items()),
        f"r2s2r import run.csv   # with the columns of {what} {_cycle(order)} in their order",
    )  # fmt: skip


def _order(what: str, order: tuple[int, ...], by: str, own: float, other: float) -> Mismatch:
    moved = {k: a for k, a in enumerate(order) if k != a}
    return Mismatch(
        "order", f"{what} {_cycle(moved)} are exchanged", f"{by} as robot.toml has them",
        f"{own:.0f} mm off, {other:.0f} mm when exchanged",
        f"r2s2r import run.csv   # with the columns of {what} {_cycle(moved)} in their order",
    )  # fmt: skip


def _cycle(order: dict[int, int]) -> str:
    """`2 and 3`, `1, 4 and 5`."""
    names = [str(k) for k in sorted(order)]
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


def _list(what: str, numbers: Sequence[int]) -> str:
    return f"{what}{'s' if len(numbers) > 1 else ''} {_cycle({k: k for k in numbers})}"

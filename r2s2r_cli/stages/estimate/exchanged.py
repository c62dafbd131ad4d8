"""Whether the rods have the colours, and the sensors the cables, that robot.toml says: lengths of both over the run.

With two colours exchanged every picture fits a robot as well as before, only that of another robot: cables that are
reeled in look as if others were. Only the sensors know which cable is which, so their lengths are compared with the
distances between sighted caps under every other naming of the caps.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.motion.data import Readings, Sighted
from schemas.robot import Robot

BETTER = 0.7
"""Another naming fits better where it leaves less than this share of the deviations: then it is the right one."""
TELLS = 1.3
"""A naming that leaves less than so many times the deviations is not told from the right one."""
TOGETHER, MEANS = 5, 300
"""Neighbouring frames whose mean is compared, so many at least; and how many means at most."""
LEAST = 6
"""Fewest means that show a cable for its sensor to count."""
FAR_M = 0.03
"""[m] A deviation from the usual counts for no more than this: sensors drop out, blobs are confused."""
WORST = 2
"""Sensors with the largest deviations that do not count: they may be broken."""
SENSORS = 3
"""Fewest sensors that can tell."""
NEAR_S = 0.1
"""[s] Readings farther from a frame than this are none of it."""
OFFSET_SHARE = 0.4
"""Of a sensor's offset that counts as a deviation: sensors are off by millimetres, other cables by centimetres."""
MOST_RODS = 4
"""Robots of more rods are checked for two rods exchanged alone."""


def check_names(
    sighted: Sighted, readings: Readings | None, robot: Robot, *, where: str
) -> tuple[np.ndarray | None, str | None]:
    """The names that the caps have, (cap,), None where they have them already; and a warning in words, or None.

    A robot at rest may look the same after half a turn, and sensors with offsets do not tell: then the two caps of
    rods are taken for each other at first, which is put right here. Raises InputError where only names that give rods
    each other's colours fit the sensors, and clearly better.
    """
    if readings is None:
        return None, None  # the report says what a run without sensors cannot tell
    p, shown = sighted.p_WE, lengths_at(sighted.t, readings)
    ends = np.array([cable.caps for cable in robot.cables])[readings.cable]
    names = list(namings(len(robot.rods)))
    found = np.array([deviation(p, shown, ends, name) for name in names])
    if not np.isfinite(found[0]):
        return None, None
    found[~np.isfinite(found)] = np.inf
    best = 1 + int(np.argmin(found[1:]))
    same_rods = [i for i, name in enumerate(names) if i and np.array_equal(name[::2] // 2, np.arange(len(robot.rods)))]
    if same_rods and found[own := min(same_rods, key=lambda i: float(found[i]))] < TELLS * found[best]:
        best = own
    if found[best] < BETTER * found[0]:
        if best in same_rods:
            turned = ", ".join(robot.rods[r].name for r in np.flatnonzero(names[best][::2] % 2))
            return names[best], (
                f"at the start the two end caps of rods {turned} were taken for each other: the lengths of the sensors "
                f"over the run put that right ({1e3 * found[0]:.1f} mm apart before, {1e3 * found[best]:.1f} mm after)"
            )
        raise InputError(
            _what(names[best], robot), where=f"robot.toml [[colors]]; {where}",
            expected="lengths of the cable sensors as the camera sees them, but for an offset each",
            received=f"{1e3 * found[0]:.1f} mm apart, {1e3 * found[best]:.1f} mm with other names",
            hint="r2s2r doctor camera --camera replay:10-record.h5 --preview see.png",
        )  # fmt: skip
    if found[best] < TELLS * found[0]:
        return None, (
            "so little moves, or the sensors err so much, that nobody can tell whether the colours belong to the rods "
            "that robot.toml says"
        )
    return None, None


def _what(naming: np.ndarray, robot: Robot) -> str:
    rods = naming[::2] // 2
    name = [rod.name for rod in robot.rods]
    hue = {color.rod: f" (hue {color.hue[0]:g} to {color.hue[1]:g})" for color in robot.colors}
    parts = [f"rod {name[r]} has that of rod {name[of]}{hue.get(name[of], '')}" for r, of in enumerate(rods) if r != of]
    return f"the colours in robot.toml are exchanged: by the cables, {', '.join(parts)}"


def namings(rods: int) -> Iterator[np.ndarray]:
    """Where each cap could be among the caps as they were named, (cap,); the names as they are come first."""
    if rods > MOST_RODS:
        yield np.arange(2 * rods)
        for a, b in itertools.combinations(range(rods), 2):
            order = np.arange(rods)
            order[[a, b]] = b, a
            yield np.stack([2 * order, 2 * order + 1], axis=1).ravel()
        return
    for places in itertools.permutations(range(rods)):
        for flip in itertools.product((0, 1), repeat=rods):
            yield np.array([2 * r + (end ^ turned) for r, turned in zip(places, flip, strict=True) for end in (0, 1)])


def deviation(p_WE: np.ndarray, shown: np.ndarray, ends: np.ndarray, naming: np.ndarray) -> float:
    """Of the sensors from the distances under a naming [m], root mean square; NaN where too few tell.

    p_WE: (frame, cap, 3), NaN where not sighted; shown: (frame, sensor), NaN where silent; ends: (sensor, 2).
    """
    apart = np.linalg.norm(p_WE[:, naming[ends[:, 0]]] - p_WE[:, naming[ends[:, 1]]], axis=-1)
    off = shown - apart
    starts = np.arange(0, len(off), max(TOGETHER, len(off) // MEANS))
    good = np.isfinite(off)
    count = np.add.reduceat(good.astype(float), starts, axis=0)
    mean = np.add.reduceat(np.where(good, off, 0.0), starts, axis=0) / np.maximum(count, 1.0)
    found = []
    for s in range(off.shape[1]):
        one = mean[count[:, s] > 0, s]
        if len(one) >= LEAST:
            middle = float(np.median(one))
            rest = np.clip(one - middle, -FAR_M, FAR_M)
            found.append(float(np.mean(rest**2)) + (OFFSET_SHARE * middle) ** 2)
    kept = np.sort(found)[: max(len(found) - WORST, SENSORS)]
    return float(np.sqrt(np.mean(kept))) if len(found) >= SENSORS else float("nan")


def lengths_at(t: np.ndarray, readings: Readings) -> np.ndarray:
    """Of each sensor the mean of its readings within NEAR_S of frames at t [s], (frame, sensor); NaN: none."""
    order = np.argsort(readings.t, kind="stable")
    stamps, length = readings.t[order], readings.length[order]
    first, last = np.searchsorted(stamps, t - NEAR_S), np.searchsorted(stamps, t + NEAR_S, side="right")
    good = np.isfinite(length)
    total = np.concatenate([np.zeros((1, length.shape[1])), np.cumsum(np.where(good, length, 0.0), axis=0)])
    count = np.concatenate([np.zeros((1, length.shape[1]), dtype=int), np.cumsum(good, axis=0)])
    some = count[last] - count[first]
    return np.where(some > 0, (total[last] - total[first]) / np.maximum(some, 1), np.nan)

"""Traps of foreign end-cap data: unit of length, another robot, an axis that is not up. Refused, never converted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.frames import fit_rod_length
from schemas.results_import import LengthUnit
from schemas.robot import Robot

UNITS: dict[LengthUnit, float] = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}
"""Length units that a column name may end in [m]."""
UNIT_WORDS: dict[LengthUnit, str] = {"m": "metres", "dm": "decimetres", "cm": "centimetres", "mm": "millimetres"}
ROD_TOLERANCE = 0.05
"""Relative departure of a rod length beyond which it is another robot or unit (`[import]` in project.toml)."""
RIGID_SD_M = 0.010
"""A rod whose length varies by more than this is not tracked as one rigid rod: four times the tracker's noise."""
NEAR_GROUND_M = 0.05
"""The lowest cap of a robot on the ground lies within this of its radius, whatever the tracker's bias."""
TWISTED = 0.1
"""Triple product of three rod axes beyond which the handedness of a robot is clear."""
CLEARLY_M = 0.010
"""Margin that one axis must win by before another is called the up axis."""


def check_rod_length(
    p_WE: np.ndarray,
    robot: Robot,
    *,
    where: str,
    unit: LengthUnit,
    tolerance: float = ROD_TOLERANCE,
    known_rods: Mapping[str, Sequence[float]] | None = None,
) -> list[str]:
    """Compare the rods of the data with robot.toml; warnings about rods that are not rigid.

    p_WE: end caps of the kept frames [m] after conversion from `unit`, shape (frame, cap, xyz). known_rods: rod
    lengths [m] of other robots by name. Raises InputError where the lengths fit another unit or another robot.
    """
    length, sd = fit_rod_length(p_WE)
    expected = np.array([rod.length_m for rod in robot.rods])
    ratio = length / expected
    if np.abs(ratio - 1).max() > tolerance:
        raise _wrong_length(p_WE, expected, where, unit, tolerance, known_rods or {})
    return [
        f"rod {i} is not rigid: its length varies by {1e3 * s:.1f} mm (sd), more than {1e3 * RIGID_SD_M:.0f} mm"
        for i, s in enumerate(sd)
        if s > RIGID_SD_M
    ]


def _wrong_length(
    p_WE: np.ndarray,
    expected: np.ndarray,
    where: str,
    unit: LengthUnit,
    tolerance: float,
    known_rods: Mapping[str, Sequence[float]],
) -> InputError:
    length, sd = fit_rod_length(p_WE)
    values = ", ".join(f"{value:.4g}" for value in length)
    robot_values = ", ".join(f"{value:.4g}" for value in expected)
    for word, size in UNITS.items():
        if word != unit and np.abs(length * (size / UNITS[unit]) / expected - 1).max() <= tolerance:
            return InputError(
                f"the end caps are in {UNIT_WORDS[word]}, the columns say {UNIT_WORDS[unit]}",
                where=where,
                expected=f"rods of {robot_values} m",
                received=f"rods of {values} m",
                hint=f"sed -i.bak -e '1s/_{unit},/_{word},/g' -e '1s/_{unit}$/_{word}/' {quoted(where)}",
            )
    pairs = _pairs(p_WE, expected, tolerance)
    if pairs:
        return InputError(
            "the caps are numbered otherwise: caps 2 i and 2 i + 1 are not the two ends of rod i",
            where=where,
            expected=f"rods of {robot_values} m between caps 0-1, 2-3 ...",
            received=f"{values} m; rods of that length lie between caps {pairs}",
            hint="rename the cap columns so that caps 0, 1 belong to the first rod of robot.toml, 2, 3 to the second",
        )
    if (sd > RIGID_SD_M).any():
        return InputError(
            "caps 2 i and 2 i + 1 do not keep their distance, so they are not the two ends of rod i",
            where=where,
            expected=f"rods of {robot_values} m",
            received=f"{values} m, varying by {', '.join(f'{1e3 * value:.0f}' for value in sd)} mm",
            hint="rename the cap columns so that caps 0, 1 belong to the first rod of robot.toml, 2, 3 to the second",
        )
    best = _best_robot(length, known_rods, tolerance)
    fits = f"; the rods fit robot {best}" if best else ""
    remedy = (
        f"r2s2r init other --robot {best}" if best else "correct rods.length_m in robot.toml (cap centre to centre)"
    )
    return InputError(
        f"the rods are not those of this project's robot{fits}",
        where=where,
        expected=f"{robot_values} m, to {100 * tolerance:g} %",
        received=f"{values} m",
        hint=remedy,
    )


def _pairs(p_WE: np.ndarray, expected: np.ndarray, tolerance: float) -> str:
    """Pairs of caps (`0-5, 1-2`) at the length of a rod in every frame, if each cap has just one such partner."""
    apart = np.linalg.norm(p_WE[:, :, None] - p_WE[:, None], axis=-1)
    length, sd = np.median(apart, axis=0), apart.std(axis=0)
    fits = (np.abs(length / expected.mean() - 1) <= tolerance) & (sd <= RIGID_SD_M)
    if not (fits.sum(axis=1) == 1).all():
        return ""
    return ", ".join(f"{i}-{j}" for i, j in np.argwhere(fits) if i < j)


def _best_robot(length: np.ndarray, known_rods: Mapping[str, Sequence[float]], tolerance: float) -> str:
    """Name of the robot with as many rods whose lengths fit best, within the tolerance; else empty."""
    errors = {
        name: float(np.abs(length / np.asarray(rods) - 1).max())
        for name, rods in known_rods.items()
        if len(rods) == len(length)
    }
    name = min(errors, key=lambda n: errors[n], default="")
    return name if name and errors[name] <= tolerance else ""


def check_up_axis(p_WE: np.ndarray, cap_radius: np.ndarray, where: str) -> list[str]:
    """Refuse data whose ground is not a plane of constant z; warn where that plane lies far from z = 0.

    p_WE: end caps of the kept frames [m], shape (frame, cap, xyz). cap_radius: [m], shape (cap,). The robot stands
    on at least three caps, at one height, all the time: along the true up axis the lowest cap hardly moves and the
    third lowest lies near it. Another axis is called up if it is twice as steady as z, or as steady as z and
    (other than z) at the height of a robot on the plane 0; of several the steadiest, before all those at that height.
    Raises InputError naming the axis.
    """
    unsteady, offset = {}, {}
    for i, axis in enumerate("xyz"):
        for sign, name in ((1.0, axis), (-1.0, f"-{axis}")):
            height = np.sort(sign * p_WE[:, :, i] - cap_radius, axis=1)
            third = height[:, min(2, height.shape[1] - 1)]
            unsteady[name] = float(height[:, 0].std() + np.median(third - height[:, 0]))
            offset[name] = float(height[:, 0].mean())
    order = sorted(unsteady, key=lambda name: (abs(offset[name]) > NEAR_GROUND_M, unsteady[name]))
    for name in order:
        if unsteady[name] + CLEARLY_M < unsteady["z"] / 2:
            raise _not_up(name, where, unsteady, offset)
    if abs(offset["z"]) > NEAR_GROUND_M:
        for name in order:
            if name != "z" and abs(offset[name]) <= NEAR_GROUND_M and unsteady[name] < unsteady["z"] + CLEARLY_M:
                raise _not_up(name, where, unsteady, offset)
        return [f"the ground lies at z = {offset['z']:.3f} m, far from 0: `estimate` must shift it"]
    return []


def check_handedness(p_WE: np.ndarray, robot: Robot, where: str) -> None:
    """Refuse the mirror image of a three-rod robot: a left-handed frame, or the ends of a rod exchanged.

    p_WE: end caps of the kept frames [m], shape (frame, cap, xyz). The triple product of the three rod axes keeps its
    sign as long as the robot does not turn inside out (real crawl -0.81 .. -0.17, rest state -0.86).
    Raises InputError.
    """
    if len(robot.rods) != 3:
        return
    seen, own = _triple_product(p_WE), _triple_product(np.array(robot.rest_caps_m))
    typical = float(np.median(seen))
    opposite = float((seen * own < 0).mean())
    if abs(own) > TWISTED and abs(typical) > TWISTED and opposite > 0.95:
        raise InputError(
            "the robot in the data is the mirror image of the one in robot.toml",
            where=where,
            expected=f"triple product of the rod axes like that of rest_caps_m, {own:+.2f}",
            received=f"{typical:+.2f}",
            hint="look for a left-handed frame (one axis negated, or two exchanged) or exchanged ends of a rod",
        )


def _triple_product(p_WE: np.ndarray) -> np.ndarray:
    """Of the unit vectors along three rods, even cap to odd cap; shape (...,)."""
    axis = p_WE[..., 1::2, :] - p_WE[..., 0::2, :]
    return np.linalg.det(axis / np.linalg.norm(axis, axis=-1, keepdims=True))


_TURN = {
    "y": "x, y, z <- x, -z, y",
    "-y": "x, y, z <- x, z, -y",
    "x": "x, y, z <- y, z, x",
    "-x": "x, y, z <- -y, z, -x",
    "-z": "x, y, z <- x, -y, -z",
}
"""Rotations (no mirror images) that bring each axis up."""


def _not_up(name: str, where: str, unsteady: Mapping[str, float], offset: Mapping[str, float]) -> InputError:
    return InputError(
        f"the z axis does not point up: the robot stands on a plane of constant {name.strip('-')} ({name} is up)",
        where=where,
        expected="world frame, z up, ground near z = 0",
        received=f"lowest cap at z = {offset['z']:.3f} m, unsteady by {unsteady['z']:.3f} m; "
        f"along {name} {offset[name]:.3f} m and {unsteady[name]:.3f} m",
        hint=f"turn the axes in the source and import again: {_TURN[name]}",
    )

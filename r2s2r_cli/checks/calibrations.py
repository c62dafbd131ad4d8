"""Offline measurements: sensors, tendons, masses."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.checks.base import AGAIN, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Content

RMS_MAX_M = 0.004
"""Straight lines through real calibrations leave 1.2-3.9 mm rms (the points that ChemStud24/tensegrity
publishes, fitted by `calibrate`); above that a point is wrong."""
GOOD = 0
"""Code of `state` for a line that can be used."""
_KINDS = ("calibration",)
_INDICES = (
    ("points", "set", "lines", "name"), ("tendon_points", "curve", "tendons", "name"),
    ("drift", "before", "history", "file"), ("drift", "after", "history", "file"),
)  # fmt: skip
"""(group, dataset) counts the rows of (group, dataset)."""


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every point and change names a set, curve or entry that is there",
    why="a point of a set that is not there was fitted to nothing",
    fix=AGAIN,
)
def calibration_rows_exist(content: Content) -> Iterator[Found]:
    """Row numbers outside their table."""
    for group, name, table, column in _INDICES:
        index, rows = _get(content, group, name), _get(content, table, column)
        if index is None:
            continue
        count = 0 if rows is None else len(rows)
        bad = (index < 0) | (index >= count)
        if bad.any():
            expected = f"0 .. {count - 1}, rows of {table}" if count else f"rows of {table}, which has none"
            yield Found(f"{group}/{name}", f"a row of {group} names a row of {table} that is not there", expected,
                        worst(index, bad.astype(float), ("row",)))  # fmt: skip


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="every sensor of the set in use has a line that can be used",
    why="a sensor with slope 0 or a falling line measures no length; robot.toml leaves it uncalibrated",
    fix="check the wires of the named sensor and measure it again; until then its cable has no sensor",
)
def sensors_are_alive(content: Content) -> Iterator[Found]:
    """Dead and falling sensors."""
    lines = content.data.groups.get("lines")
    state = _get(content, "lines", "state")
    if lines is None or state is None:
        return
    meaning = {code: text for d in _specs(content, "lines") if d.path == "state" for code, text in d.codes.items()}
    for row, name in _sets(lines):
        for sensor in np.flatnonzero(state[row] != GOOD).tolist():
            yield Found("lines/state", f"sensor {sensor} of set {name} cannot be used", "a line that rises",
                        meaning[int(state[row, sensor])])  # fmt: skip


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="the line of every sensor fits its points within 4 mm rms",
    why="real sensors fit within 1.2 to 3.9 mm; beyond that a point was misread or the sensor slips",
    fix="look at the point with the largest residual in calibration-sensors-SET.png, and measure it again",
)
def residuals_are_small(content: Content) -> Iterator[Found]:
    """Lines that do not fit."""
    lines, rms = content.data.groups.get("lines"), _get(content, "lines", "rms")
    if lines is None or rms is None:
        return
    for row, name in _sets(lines):
        high = beyond(rms[row], -np.inf, RMS_MAX_M)
        if (high > 0).any():
            yield Found("lines/rms", f"a line of set {name} does not fit its points",
                        f"at most {number(RMS_MAX_M, 1e3)} mm rms",
                        worst(rms[row], high, ("sensor",), scale=1e3, unit="mm"),
                        f"look at its largest residual in {_picture(name)}, and measure that point again")  # fmt: skip


def _picture(name: str) -> str:
    """File name of the picture of a set; names that make no file name are numbered there, so it is described."""
    return f"calibration-sensors-{name}.png" if re.fullmatch(r"[\w.-]+", name) else f"the picture of set {name}"


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="every tendon curve rises on its measured range",
    why="where the force falls with the stretch, the tendon snaps through and the simulator with it",
    fix="look at the named curve in calibration-tendons.png: a wrong point, or too few points for a cubic",
)
def tendons_rise(content: Content) -> Iterator[Found]:
    """Curves with a slope below 0."""
    tendons, monotone = content.data.groups.get("tendons"), _get(content, "tendons", "monotone")
    if tendons is None or monotone is None:
        return
    stiffness = tendons["stiffness_min"]
    for row, name in enumerate(_names(tendons)):
        if not monotone[row]:
            yield Found("tendons/monotone", f"the fit of curve {name} falls with the stretch", "a slope above 0 N/m",
                        f"{number(stiffness[row])} N/m")  # fmt: skip
    if tendons.attributes.get("monotone") is False:
        yield Found("tendons@monotone", "the average of the curves falls with the stretch", "a slope above 0 N/m",
                    "a slope below it on the common range")  # fmt: skip


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="masses and moments of inertia are above 0, and a rod is harder to turn across than about its axis",
    why="a rod is long and thin; other numbers are grams, millimetres or a part in the wrong place",
    fix=f"{AGAIN}   # first give masses in kg and lengths in m in the parts table",
)
def masses_make_a_rod(content: Content) -> Iterator[Found]:
    """Masses that no rod has."""
    for name, unit in (("mass", "kg"), ("inertia_axial", "kg m^2"), ("inertia_transverse", "kg m^2")):
        value = _get(content, "masses", name)
        if value is not None and (value <= 0).any():
            yield Found(f"masses/{name}", f"{name.replace('_', ' ')} of a rod is not above 0", f"above 0 {unit}",
                        worst(value, (value <= 0) * (1.0 - value), ("row",), unit=unit))  # fmt: skip
    axial, transverse = _get(content, "masses", "inertia_axial"), _get(content, "masses", "inertia_transverse")
    if axial is not None and transverse is not None and (axial > transverse).any():
        yield Found("masses/inertia_axial", "a rod is harder to turn about its axis than across",
                    "less than inertia_transverse",
                    worst(axial, np.maximum(axial - transverse, 0.0), ("row",), unit="kg m^2"))  # fmt: skip


@check(
    "advice",
    Content,
    kinds=_KINDS,
    what="the history of calibrations holds no failed fit",
    why="drift is estimated from what is left; a failed fit is a day without that sensor",
    fix="take the failed fits out of the history, or measure those sensors again",
)
def history_is_sound(content: Content) -> Iterator[Found]:
    """Failed fits in the history."""
    state = _get(content, "history", "state")
    if state is not None and (state != GOOD).any():
        entries, columns = np.nonzero(state != GOOD)
        sensors = ", ".join(map(str, np.unique(columns).tolist()))
        yield Found("history/state", "the history holds fits that failed or are suspect", "lines that rise",
                    f"{len(entries)} of {state.size}, of sensor {sensors}")  # fmt: skip


def _get(content: Content, group: str, name: str) -> np.ndarray | None:
    found = content.data.groups.get(group)
    value = found.datasets.get(name) if found is not None else None
    return value if isinstance(value, np.ndarray) else None


def _specs(content: Content, group: str) -> tuple:
    spec = content.spec.group(group)
    return spec.datasets if spec else ()


def _names(group: Group) -> list[str]:
    items = group["name"].tolist()
    return [item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item) for item in items]


def _sets(lines: Group) -> Iterator[tuple[int, str]]:
    """(row, name) of the set in use, or of every set where none is named."""
    used = lines.attributes.get("used")
    names = _names(lines)
    yield from ((row, name) for row, name in enumerate(names) if used is None or used not in names or name == used)

"""Weighed parts -> mass, centre of mass and inertia of each rod.

Paper, "Offline Robot Measurements": masses and dimensions of the components are measured and used as inputs.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.source import Source, near
from schemas.robot import Lump, Robot, Rod

UNIT_MARGIN = 1000**0.5
"""Grams for kilograms is a factor 1000: a rod may differ from robot.toml by its square root."""

_KEYS = ("rod", *Lump.model_fields)
_SIZES = {
    "point": (),
    "sphere": ("radius_m",),
    "cylinder": ("radius_m", "length_m"),
    "tube": ("radius_m", "length_m", "inner_radius_m"),
}
"""The dimensions that each shape has; the others must be absent or zero."""


@dataclass(frozen=True)
class MassProperties:
    """`mass` [kg]; `com` [m], along the rod from the middle between its caps, positive towards the odd cap;
    `inertia_axial`, `inertia_transverse` [kg m^2] about the centre of mass."""

    mass: float
    com: float
    inertia_axial: float
    inertia_transverse: float


def mass_properties(parts: Sequence[Lump]) -> MassProperties:
    """Sum solids on one axis: inertia of each about its own centre, moved to the common one (parallel axes)."""
    mass = sum(part.mass_kg for part in parts)
    com = sum(part.mass_kg * part.offset_m for part in parts) / mass
    own = [own_inertia(part) for part in parts]
    transverse = (i + part.mass_kg * (part.offset_m - com) ** 2 for part, (_, i) in zip(parts, own, strict=True))
    return MassProperties(mass, com, sum(axial for axial, _ in own), sum(transverse))


def own_inertia(part: Lump) -> tuple[float, float]:
    """(axial, transverse) moments of inertia [kg m^2] of one solid about its own centre."""
    m, r, length = part.mass_kg, part.radius_m, part.length_m
    if part.shape == "point":
        return 0.0, 0.0
    if part.shape == "sphere":
        return 0.4 * m * r**2, 0.4 * m * r**2
    square = r**2 + (part.inner_radius_m**2 if part.shape == "tube" else 0.0)
    return m * square / 2, m * (3 * square + length**2) / 12


def read_masses(source: Source, robot: Robot) -> dict[str, tuple[Lump, ...]]:
    """Read `[[part]]` tables; a part without `rod` belongs to every rod. Returns the parts of each rod mentioned.

    Raises InputError with the line of the table.
    """
    try:
        document = tomllib.loads(source.text())
    except (ValueError, RecursionError) as error:
        raise InputError(
            "the masses are not valid TOML", where=source.name, expected="[[part]] tables", received=str(error)[:120],
            hint="correct the file at that place",
        ) from None  # fmt: skip
    tables = document.pop("part", None)
    if document or not isinstance(tables, list) or not tables:
        raise InputError(
            "the masses are not a list of parts", where=source.name, expected="[[part]] tables and nothing else",
            received=", ".join(document) or "no [[part]] table", hint="begin every part with a line [[part]]",
        )  # fmt: skip
    places = _Places(source, len(tables))
    rods = {rod.name: rod for rod in robot.rods}
    found: dict[str, list[Lump]] = {}
    numbers: dict[str, list[int]] = {}
    for i, table in enumerate(tables):
        part, names = _part(table, i, places, list(rods))
        for name in names:
            _check(part, rods[name], i, places)
            if any(other.name == part.name for other in found.setdefault(name, [])):
                raise InputError(
                    "two parts of one rod have the same name", where=places.of(i, "name"),
                    expected="each name once a rod",
                    received=f"{part.name} again on rod {name}", hint="number the parts: motor 1, motor 2",
                )  # fmt: skip
            found[name].append(part)
            numbers.setdefault(name, []).append(i)
    for name, parts in found.items():
        heaviest = max(range(len(parts)), key=lambda j: parts[j].mass_kg)
        _check_total(parts, rods[name], places.of(numbers[name][heaviest], "mass_kg"))
    return {rod.name: tuple(found[rod.name]) for rod in robot.rods if rod.name in found}


class _Places:
    """Where the parts of a text stand: the line of each `[[part]]`, and of the keys below it."""

    def __init__(self, source: Source, count: int) -> None:
        self._name = source.name
        self._text = source.text().splitlines()
        heads = [i for i, text in enumerate(self._text) if re.match(r"\s*\[\[\s*[\"']?part[\"']?\s*\]\]", text)]
        self._heads = heads if len(heads) == count else []  # else: parts in one list, or a head in a text

    def of(self, part: int, key: str = "") -> str:
        """`masses.toml, line 12, part 2, mass_kg`: the line of the key, or of the part where it has no such key."""
        line = ""
        if self._heads:
            first, last = self._heads[part], [*self._heads, len(self._text)][part + 1]
            own = (i for i in range(first, last) if re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*=", self._text[i]))
            line = f", line {next(own, first) + 1}"
        return f"{self._name}{line}, part {part + 1}" + (f", {key}" if key else "")


def _part(table: Any, number: int, places: _Places, rods: list[str]) -> tuple[Lump, list[str]]:
    if not isinstance(table, dict):
        raise InputError(
            "a part is not a table", where=places.of(number), expected="[[part]] with name, mass_kg, offset_m, shape",
            received=repr(table)[:80], hint="begin every part with a line [[part]]",
        )  # fmt: skip
    for key in table:
        if key not in _KEYS:
            raise InputError(
                "unknown key" + near(key, _KEYS), where=places.of(number, key[:80]),
                expected=", ".join(_KEYS), received=key[:80],
                hint="rename or remove the key; lengths are in m, masses in kg",
            )  # fmt: skip
    rod = table.get("rod")
    if rod is not None and rod not in rods:
        raise InputError(
            "the robot has no such rod" + near(str(rod), rods), where=places.of(number, "rod"),
            expected=", ".join(rods), received=repr(rod)[:80],
            hint="name a rod of robot.toml, or leave `rod` out for a part of every rod",
        )  # fmt: skip
    try:
        part = Lump.model_validate({key: value for key, value in table.items() if key != "rod"}, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(item) for item in first["loc"])
        raise InputError(
            "a part cannot be used as it is", where=places.of(number, key),
            expected=first["msg"].removeprefix("Value error, "),
            received="nothing" if first["type"] == "missing" else repr(first["input"])[:80],
            hint=f"correct {key} of this part",
        ) from None  # fmt: skip
    return part, rods if rod is None else [rod]


def _check(part: Lump, rod: Rod, number: int, places: _Places) -> None:
    for key in ("radius_m", "length_m", "inner_radius_m"):
        value = getattr(part, key)
        needed = key in _SIZES[part.shape]
        if needed != (value > 0):
            raise InputError(
                f"a {part.shape} {'needs' if needed else 'has no'} {key}", where=places.of(number, key),
                received=f"{value:g} m",
                expected=f"{', '.join(_SIZES[part.shape]) or 'no dimension'} for the shape {part.shape}",
                hint=f"{'add' if needed else 'remove'} {key}, or change the shape",
            )  # fmt: skip
    if part.shape == "tube" and part.inner_radius_m >= part.radius_m:
        raise InputError(
            "the inside of a tube is wider than its outside", where=places.of(number, "inner_radius_m"),
            expected="inner_radius_m below radius_m", received=f"{part.inner_radius_m:g} m in {part.radius_m:g} m",
            hint="exchange the two radii",
        )  # fmt: skip
    tip = rod.length_m / 2 + rod.cap_radius_m
    reach = max(abs(part.offset_m) + part.length_m / 2, abs(part.offset_m))
    if reach > tip * 1.1 or part.radius_m > tip:
        raise InputError(
            "a part that does not lie on the rod",
            where=places.of(number, "radius_m" if part.radius_m > tip else "offset_m"),
            expected=f"within {tip:.4g} m of the middle of rod {rod.name} (a tenth more is let pass)",
            received=f"{max(reach, part.radius_m):.4g} m", hint="give offset_m, length_m and radius_m in metres",
        )  # fmt: skip


def _check_total(parts: Sequence[Lump], rod: Rod, where: str) -> None:
    new, old = sum(part.mass_kg for part in parts), sum(part.mass_kg for part in rod.parts)
    if not old / UNIT_MARGIN < new < old * UNIT_MARGIN:
        raise InputError(
            f"the parts of rod {rod.name} weigh too little or too much for this robot", where=where,
            expected=f"about the {old:.4g} kg of robot.toml", received=f"{new:.4g} kg",
            hint="give mass_kg in kilograms",
        )  # fmt: skip

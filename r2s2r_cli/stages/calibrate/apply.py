"""Put measured numbers into the text of robot.toml; comments, order and everything else stay as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import InputError, NumericalError
from r2s2r_cli.stages.calibrate.robot_text import comment, cut_tail, edited, put, rounded, set_value
from r2s2r_cli.stages.calibrate.tendons import stiffness_min
from schemas.results_calibrate import RobotChanges
from schemas.robot import Lump

if TYPE_CHECKING:
    from tomlkit.items import Table

_TENDON_KEYS = ("stiffness_n_per_m", "stiffness2_n_per_m2", "stiffness3_n_per_m3")


def apply_changes(text: str, changes: RobotChanges) -> str:
    """Make all changes of a calibration report. Returns `text` itself where there are none.

    Raises InputError where `text`, or the result, is no valid robot description; see the single edits below.
    """
    for source in dict.fromkeys(change.source for change in changes.sensors.values()):
        lines = {i: (c.slope_f_per_m, c.offset_f) for i, c in changes.sensors.items() if c.source == source}
        text = with_sensor_line(text, lines, source=source)
    if changes.tendon is not None:
        new = changes.tendon
        text = with_tendon(text, new.k1_n_per_m, new.k2_n_per_m2, new.k3_n_per_m3, source=new.source)
    for rod, change in changes.rods.items():
        text = with_parts(text, rod, change.parts, source=change.source)
    return text


def with_sensor_line(text: str, lines: Mapping[int, tuple[float, float]], *, source: str = "") -> str:
    """Set slope [F/m] and offset [F] of sensors, by their position among the [[sensors]] tables.

    source: where the numbers come from, for the comment behind each (`set X, rms 1.2 mm`). Raises InputError for a
    sensor that is not there or numbers that are not finite.
    """

    def edit(document: Any) -> None:
        tables = document.get("sensors", [])
        for sensor, (slope, offset) in lines.items():
            if not 0 <= sensor < len(tables):
                raise _absent(f"sensors.{sensor}", f"{len(tables)} [[sensors]] tables")
            set_value(tables[sensor], "slope_f_per_m", slope, source)
            set_value(tables[sensor], "offset_f", offset, source)

    return edited(text, edit)


def with_tendon(text: str, k1: float, k2: float, k3: float, *, x_max: float | None = None, source: str = "") -> str:
    """Give every passive cable the force k1 x + k2 x^2 + k3 x^3 ([N/m], [N/m^2], [N/m^3], x [m]).

    x_max [m]: range on which the force must rise. Raises NumericalError where it does not, or where k1 <= 0 (a cable
    without stiffness at rest), InputError where the robot has no passive cable.
    """
    lowest = stiffness_min((k1, k2, k3), x_max) if x_max is not None else k1
    if not lowest > 0 or not k1 > 0:
        raise NumericalError(
            "the average tendon curve does not rise everywhere", where="tendons", expected="a stiffness above 0",
            received=f"{k1:.6g} N/m at rest, {lowest:.6g} N/m at its smallest",
            hint="look at the picture of the curves, leave out the ones that slipped",
        )  # fmt: skip

    def edit(document: Any) -> None:
        passive = [table for table in document.get("cables", []) if table.get("kind") == "passive"]
        if not passive:
            raise _absent("cables", "no [[cables]] table of kind passive")
        for table in passive:
            for key, value in zip(_TENDON_KEYS, (k1, k2, k3), strict=True):
                set_value(table, key, value, source)

    return edited(text, edit)


def with_parts(text: str, rod: str | None, parts: Sequence[Lump], *, source: str = "") -> str:
    """Replace the parts of one rod, or of all rods (None). A part that keeps its name keeps its comments."""

    def edit(document: Any) -> None:
        tables = [table for table in document.get("rods", []) if rod is None or table.get("name") == rod]
        if not tables:
            raise _absent(f"rod {rod}", "no [[rods]] table of that name")
        for table in tables:
            _set_parts(table, parts, source)

    return edited(text, edit)


def _absent(where: str, received: str) -> InputError:
    return InputError(
        "robot.toml lacks what the measurement belongs to", where=f"robot.toml, {where}", expected="its table",
        received=received, hint="add the table to robot.toml, or calibrate in the project of the robot measured",
    )  # fmt: skip


def _set_parts(rod: Any, parts: Sequence[Lump], source: str) -> None:
    import tomlkit
    from tomlkit.items import AoT

    old = rod["parts"]
    if not isinstance(old, AoT):
        array = tomlkit.array().multiline(True)
        for part in parts:
            inline = tomlkit.inline_table()
            inline.update(_fields(part))
            array.append(inline)
        rod["parts"] = array
        comment(rod["parts"], source)
        return

    new = {part.name: part for part in parts}
    tail = cut_tail(old[-1])
    for i in reversed(range(len(old))):
        name = str(old[i]["name"])
        if name not in new:
            orphans = [] if i == len(old) - 1 else cut_tail(old[i])
            (old[i - 1].value.body if i else tail).extend(orphans)
    kept = [table for table in old if str(table["name"]) in new]
    for table in kept:
        _update_part(table, new.pop(str(table["name"])), source)
    indent = old[0].trivia.indent
    first = old[0].value.body[0][1].trivia.indent
    for part in new.values():
        table = tomlkit.table()
        table.trivia.indent = indent
        old.append(table)
        for key, value in _fields(part).items():
            old[-1][key] = value
            old[-1][key].trivia.indent = first
        comment(old[-1]["mass_kg"], source)
    for i in reversed(range(len(old))):
        if str(old[i]["name"]) not in {part.name for part in parts}:
            del old[i]
    old[-1].value.body.extend(tail)


def _update_part(table: Table, part: Lump, source: str) -> None:
    fields = _fields(part)
    for key in [key for key in table if key in Lump.model_fields and key not in fields]:
        del table[key]
    for key, value in fields.items():
        if table.get(key) == value:
            continue
        if isinstance(value, float):
            set_value(table, key, value, source)
        else:
            put(table, key, value)


def _fields(part: Lump) -> dict[str, str | float]:
    """What is written of a part: its numbers as measured, dimensions only where the shape has them."""
    values: dict[str, str | float] = {"name": part.name, "shape": part.shape}
    values |= {"mass_kg": rounded(part.mass_kg, "mass_kg"), "offset_m": rounded(part.offset_m, "offset_m")}
    sizes = {key: getattr(part, key) for key in ("radius_m", "length_m", "inner_radius_m")}
    return values | {key: rounded(value, key) for key, value in sizes.items() if value > 0}

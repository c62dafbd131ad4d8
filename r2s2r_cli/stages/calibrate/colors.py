"""Put measured colour ranges into the text of robot.toml; comments, order and everything else stay as they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.robot_text import edited, set_value
from schemas.robot import HsvRange

_COMMENT = "Colours of the rods' caps in the camera's picture: hue 0..180, saturation and value 0..255, as in OpenCV."


def with_colors(text: str, ranges: Sequence[HsvRange], *, source: str = "") -> str:
    """Set the [[colors]] tables of these rods, and add those that are not there.

    source: where they come from, for the comment behind each. Raises InputError where `text`, or the result, is no
    valid robot description, and where a table of colours is written in braces.
    """
    return edited(text, lambda document: _set_all(document, ranges, source))


def _set_all(document: Any, ranges: Sequence[HsvRange], source: str) -> None:
    import tomlkit
    from tomlkit.items import AoT

    tables = document.get("colors")
    if tables is None:
        document.add(tomlkit.nl())
        document.add(tomlkit.comment(_COMMENT))
        tables = document["colors"] = tomlkit.aot()
    if not isinstance(tables, AoT):
        raise InputError(
            "robot.toml holds its colours in a list of braces, where a comment cannot stand",
            where="robot.toml, colors", expected="[[colors]] tables", received="colors = [...]",
            hint="write one [[colors]] table per rod, as `r2s2r init` does",
        )  # fmt: skip
    for color in ranges:
        table = next((t for t in tables if t.get("rod") == color.rod), None)
        if table is None:
            new = tomlkit.table()
            new["rod"] = color.rod
            new["hue"] = list(color.hue)
            if len(tables):
                tables[-1].add(tomlkit.nl())
            tables.append(new)
            table = tables[-1]
        set_value(table, "hue", [_plain(x) for x in color.hue], source)
        set_value(table, "saturation_min", color.saturation_min, source)
        set_value(table, "value_min", color.value_min, source)


def _plain(value: float) -> float | int:
    return int(value) if value == int(value) else value

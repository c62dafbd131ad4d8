"""The text of robot.toml, edited in place: values and their comments, the rest as it stands."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from r2s2r_cli.errors import InputError
from schemas.robot import Robot

if TYPE_CHECKING:
    from tomlkit.items import Table

DIGITS = 7
"""Significant digits written: an error of 1e-7 in a 20 pF offset is 0.1 micrometre of length."""

MARK = "calibrate"
"""First word of the comments that are written here, and that a later calibration replaces."""

_BEFORE = " | before: "


def edited(text: str, edit: Callable[[Any], None]) -> str:
    """The text after `edit` of its tomlkit document. Raises InputError where it, or the result, is no valid robot."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    _validate(text, "robot.toml")
    try:
        document = tomlkit.parse(text)
        edit(document)
        result = tomlkit.dumps(document)
    except TOMLKitError as error:
        raise InputError(
            "robot.toml cannot be edited in place", where="robot.toml", expected="TOML that tomlkit understands",
            received=str(error)[:120], hint="write [[sensors]], [[cables]], [[rods]] tables, as `r2s2r init` does",
        ) from None  # fmt: skip
    _validate(result, "robot.toml after the change")
    return result


def _validate(text: str, where: str) -> None:
    try:
        Robot.model_validate(tomllib.loads(text))
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            "the robot description is not valid", where=f"{where}, {'.'.join(map(str, first['loc']))}",
            expected=first["msg"].removeprefix("Value error, "), received=repr(first["input"])[:80],
            hint="r2s2r validate",
        ) from None  # fmt: skip
    except (ValueError, RecursionError) as error:
        raise InputError(
            "the robot description is not valid TOML", where=where, expected="TOML", received=str(error)[:120],
            hint="correct the file at that place",
        ) from None  # fmt: skip


def set_value(table: Any, key: str, value: float | list[float | int], source: str) -> None:
    """Set a number, or a list of them, and its comment; what the user wrote there stays behind the new one.

    Raises InputError for a table in braces, and for a number that is not finite.
    """
    from tomlkit.items import Table

    number = value if isinstance(value, list) else rounded(value, key)
    if not isinstance(table, Table):
        raise InputError(
            "robot.toml holds an inline table where a comment cannot stand", where=f"robot.toml, {key}",
            expected="a table of its own, [[sensors]], [[cables]] or [[colors]]", received="an inline table in braces",
            hint="write one table in double brackets per element, as `r2s2r init` does",
        )  # fmt: skip
    old = table[key].trivia.comment.lstrip("# ").rstrip() if key in table else ""
    if old == MARK or old.startswith(f"{MARK}: "):  # ours; "calibrated by hand" is the user's and stays
        old = old.partition(_BEFORE)[2]
    put(table, key, number)
    comment(table[key], source, old)


def comment(item: Any, source: str, before: str = "") -> None:
    """Say beside an item where its value comes from; before: what the user said there."""
    # Names of sets come from files: a line break in one would end the comment.
    note = f"{MARK}: {source}" if source else MARK
    text = note + (f"{_BEFORE}{before}" if before else "")
    item.comment("".join(c if c.isprintable() else " " for c in text))
    item.trivia.comment_ws = "  "


def put(table: Table, key: str, value: str | float | list[float | int]) -> None:
    """Set a value; a new key goes below the last one, above blank lines and the comments of the next table."""
    if key in table:
        table[key] = value
        return
    body = table.value.body
    indent = next((item.trivia.indent for name, item in body if name is not None), "")
    tail = cut_tail(table)
    table[key] = value
    table[key].trivia.indent = indent
    table.value.body.extend(tail)


def cut_tail(table: Table) -> list[Any]:
    """Take the blank lines and comments off the end of a table."""
    body = table.value.body
    cut = len(body)
    while cut and body[cut - 1][0] is None:
        cut -= 1
    tail = list(body[cut:])
    del body[cut:]
    return tail


def rounded(value: float, name: str) -> float:
    """To DIGITS. Raises InputError, which names it, for a value that is not finite."""
    if not math.isfinite(value):
        raise InputError(
            "not a finite number for robot.toml", where=name, expected="a finite number", received=repr(value),
            hint="leave the sensor or curve out whose fit failed",
        )  # fmt: skip
    return float(f"{value:.{DIGITS}g}")

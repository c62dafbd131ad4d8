"""What the user measured, as a named text; tables are read strictly, with the line of every complaint."""

from __future__ import annotations

import csv
import io
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Literal

from r2s2r_cli.errors import InputError
from r2s2r_cli.nearest import nearest

_OTHER_DELIMITERS = {";": ("semicolons", ";"), "\t": ("tabs", "\\t"), "|": ("bars", "|")}
"""What else separates columns: in words, and as `sed` writes it."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Source:
    """A file that the user gave: its name as the user typed it, and its bytes."""

    name: str
    data: bytes

    @property
    def stem(self) -> str:
        """The name without folder and suffix."""
        return PurePath(self.name).stem

    def text(self) -> str:
        """The text, UTF-8 with or without a byte-order mark. Raises InputError for anything else."""
        try:
            return self.data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise InputError(
                "a text file was expected",
                where=f"{self.name}, byte {error.start}",
                expected="UTF-8 text",
                received=f"byte 0x{self.data[error.start]:02x}",
                hint="export the table as CSV with UTF-8 encoding (spreadsheet files cannot be read)",
            ) from None


@dataclass(frozen=True)
class Column:
    """One column: the headers that it may have, each with its factor to SI."""

    name: str
    headers: Mapping[str, float]
    kind: Literal["number", "integer", "text"] = "number"
    required: bool = True


@dataclass(frozen=True)
class Table:
    """The rows of a CSV file. `values[column]` holds floats in SI, integers or texts; `lines` is 1-based."""

    source: str
    lines: tuple[int, ...]
    values: Mapping[str, tuple[float, ...] | tuple[int, ...] | tuple[str, ...]]
    headers: Mapping[str, str] = field(default_factory=dict)
    """Header that each column was found under; a column that is absent is missing here."""


def read_table(source: Source, columns: Sequence[Column], example: str) -> Table:
    """Read a comma-separated table with a header. `example`: a header line that would be right, for the hints.

    Raises InputError for anything that is not exactly that: other columns, two units of one quantity,
    rows of another width, texts where numbers belong, NaN and infinity.
    """
    rows = _rows(source, example)
    header = [name.strip() for name in rows[0][1]]
    found = _match(source, rows[0][0], header, columns, example)
    lines: list[int] = []
    values: dict[str, list[float | int | str]] = {column.name: [] for column, _ in found.values()}
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise InputError(
                "a row has another number of values than the header",
                where=f"{source.name}, line {line}",
                expected=f"{len(header)} values: {', '.join(header)}",
                received=f"{len(row)} values: {', '.join(row)}"[:200],
                hint="give one value per column; the decimal sign is a point, the separator a comma",
            )
        lines.append(line)
        for position, (column, factor) in found.items():
            where = f"{source.name}, line {line}, column {header[position]}"
            values[column.name].append(_value(row[position].strip(), column, factor, where))
    if not lines:
        raise InputError(
            "the table has no rows", where=source.name, expected="one row per measured point", received="a header only",
            hint=f"add the measured rows below the header {example}",
        )  # fmt: skip
    return Table(
        source.name,
        tuple(lines),
        {name: tuple(column) for name, column in values.items()},  # type: ignore[misc]
        {column.name: header[position] for position, (column, _) in found.items()},
    )


def near(word: str, known: Sequence[str]) -> str:
    """`, did you mean ...` for a misspelt word, or nothing."""
    match = nearest(word, known)
    return f", did you mean {match}?" if match else ""


def _rows(source: Source, example: str) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(source.text(), newline=""), strict=True)
    rows = []
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                rows.append((reader.line_num, row))
    except csv.Error as error:
        raise InputError(
            "the table cannot be read as CSV",
            where=f"{source.name}, line {reader.line_num}",
            expected="comma-separated values, double quotes closed on their line",
            received=str(error),
            hint="export the table as CSV with commas",
        ) from None
    if not rows:
        raise InputError(
            "the table is empty", where=source.name, expected=f"the header {example}", received="no line",
            hint=f"begin the file with the header {example}",
        )  # fmt: skip
    _refuse_delimiter(source, rows[0][1], rows[1:])
    return rows


def _refuse_delimiter(source: Source, header: list[str], rows: Sequence[tuple[int, list[str]]]) -> None:
    """Refuse a table whose columns are not separated by commas, with the command that makes it one that is."""
    for delimiter, (word, escaped) in _OTHER_DELIMITERS.items():
        if len(header) == 1 and delimiter in header[0]:
            decimal_comma = any(len(row) > 1 for _, row in rows[:1])
            script = ("s/,/./g; " if decimal_comma else "") + f"s/{escaped}/,/g"
            raise InputError(
                f"the columns are separated by {word}" + (" and decimals by commas" if decimal_comma else ""),
                where=f"{source.name}, line 1",
                expected="commas between columns, points in decimals",
                received=word,
                hint=f"sed -i.bak '{script}' {shlex.quote(source.name)}",
            )


def _match(
    source: Source, line: int, header: list[str], columns: Sequence[Column], example: str
) -> dict[int, tuple[Column, float]]:
    known = [name for column in columns for name in column.headers]
    found: dict[int, tuple[Column, float]] = {}
    taken: dict[str, str] = {}
    for position, name in enumerate(header):
        column = next((c for c in columns if name in c.headers), None)
        where = f"{source.name}, line {line}, column {position + 1}"
        if column is None:
            raise InputError(
                "unknown column" + near(name, known), where=where, expected=", ".join(known),
                received=name or "(no name)", hint=f"use the header {example}",
            )  # fmt: skip
        if column.name in taken:
            raise InputError(
                f"two columns hold the {column.name}", where=where, expected="one column, one unit",
                received=f"{taken[column.name]} and {name}", hint="keep one of the two columns",
            )  # fmt: skip
        taken[column.name] = name
        found[position] = (column, column.headers[name])
    for column in columns:
        if column.required and column.name not in taken:
            raise InputError(
                f"the column with the {column.name} is missing", where=f"{source.name}, line {line}",
                expected=" or ".join(column.headers), received=", ".join(header)[:200],
                hint=f"use the header {example}",
            )  # fmt: skip
    return found


def _value(text: str, column: Column, factor: float, where: str) -> float | int | str:
    if column.kind == "text":
        if not text:
            raise InputError("a name is missing", where=where, expected="a text", received="nothing", hint="fill it in")
        return text
    if column.kind == "integer":
        if not re.fullmatch(r"\d{1,9}", text):
            raise InputError(
                "not a whole number", where=where, expected="a whole number, 0 or more", received=repr(text)[:80],
                hint="write it without sign, point or unit",
            )  # fmt: skip
        return int(text)
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise InputError(
            "not a number", where=where, expected="a finite decimal number", received=repr(text)[:80],
            hint="remove the row, or write the value with a decimal point and without its unit",
        )  # fmt: skip
    return value * factor

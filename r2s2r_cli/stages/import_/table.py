"""A strict reader of numeric CSV: every cell is a number, every error has its line and column."""

from __future__ import annotations

import csv
import io
import math
from array import array
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.import_.files import decode, in_place, shown

MAX_COLUMNS = 2000
"""Far above any robot; a header longer than this is no header."""
_OTHER_DELIMITERS = {";": "semicolons", "\t": "tabs", "|": "bars"}


@dataclass(frozen=True)
class Table:
    """Numbers with the names of their columns."""

    where: str
    names: tuple[str, ...]
    values: np.ndarray
    """float64, shape (row, column); NaN where the cell says nan."""
    line: np.ndarray
    """Line of the file on which each row ends, 1-based, int64, shape (row,)."""

    def place(self, row: int, column: int) -> str:
        """`file:line, column 4 (cap0_z_m)`."""
        return f"{self.where}:{self.line[row]}, column {column + 1} ({self.names[column]})"


def read_table(data: bytes, where: str) -> Table:
    """Parse comma-separated UTF-8 with one header line.

    Accepted: byte-order mark, LF or CRLF, quoted cells, blank lines, blanks around a cell, `nan`. Refused with an
    InputError: another delimiter or encoding, no header, no rows, rows of another length, cells that are not plain
    decimal numbers, infinities.
    """
    text = decode(data, "the CSV", where)
    if not text.strip():
        raise InputError(
            "the CSV is empty", where=where, expected="a header line and one row a frame", hint=f"wc {quoted(where)}"
        )
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    values, lines = array("d"), array("q")
    names: tuple[str, ...] = ()
    plain = False
    try:
        for cells in reader:
            if not cells:
                continue
            if not names:
                names = _header(cells, text, where)
                plain = text.isascii() and text.count("_") == sum(cell.count("_") for cell in cells)
                continue
            if len(cells) != len(names):
                raise _ragged(cells, names, f"{where}:{reader.line_num}")
            # float() also takes 1_000 and foreign digits: only where there are none may it judge alone.
            if not (plain and _fast(cells, values)):
                _numbers(cells, values, names, f"{where}:{reader.line_num}")
            lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(
            "the CSV is broken",
            where=f"{where}:{reader.line_num}",
            expected="quotes that are closed, cells below 128 KiB",
            received=str(error),
            hint=f"sed -n {reader.line_num}p {quoted(where)} | cut -c1-300",
        ) from error
    if not lines:
        raise InputError(
            "the CSV holds a header and no rows",
            where=where,
            expected="one row a frame",
            hint="record the run again, or export it with its rows",
        )
    shape = (len(lines), len(names))
    return Table(
        where=where,
        names=names,
        values=np.frombuffer(values, dtype=np.float64).reshape(shape),
        line=np.frombuffer(lines, dtype=np.int64),
    )


def _header(cells: list[str], text: str, where: str) -> tuple[str, ...]:
    """Names of the columns, or an error that says what stands there instead."""
    line = text.lstrip().splitlines()[0]
    if len(cells) == 1:
        for delimiter, word in _OTHER_DELIMITERS.items():
            if delimiter in line:
                raise _delimiter(delimiter, word, text, where)
        if len(line.split()) > 3 and not line.startswith("#"):
            raise InputError(
                "the columns are separated by blanks",
                where=f"{where}:1",
                expected="commas",
                received=shown(line),
                hint=in_place(where, "tr -s ' ' ','"),
            )
    if len(cells) > MAX_COLUMNS:
        raise InputError(
            "the header has too many columns",
            where=f"{where}:1",
            expected=f"at most {MAX_COLUMNS}",
            received=str(len(cells)),
            hint=f"head -n 1 {quoted(where)} | cut -c1-300",
        )
    names = tuple(cell.strip() for cell in cells)
    if names[0].startswith("#"):
        raise InputError(
            "the CSV begins with a comment",
            where=f"{where}:1",
            expected="the names of the columns",
            received=shown(line),
            hint=f"{in_place(where, 'grep -v ^#')}   # after putting it into the sidecar's source",
        )
    if "" in names:
        raise InputError(
            "a column has no name",
            where=f"{where}:1, column {names.index('') + 1}",
            expected="a name",
            received="nothing: a comma too many?",
            hint=f"{in_place(where, f'cut -d, --complement -f{names.index(str()) + 1}')}   # or name it",
        )
    if all(_number(name) is not None for name in names):
        raise InputError(
            "the first line must name the columns",
            where=f"{where}:1",
            expected="t_s,cap0_x_m,cap0_y_m, ...",
            received=shown(",".join(names)),
            hint="put a header line on top, see docs/guides/import.md",
        )
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(
                f"column {shown(name)} stands twice",
                where=f"{where}:1, column {i + 1}",
                expected="each column once",
                received=f"also column {names.index(name) + 1}",
                hint="take one of the two out",
            )
    return names


def _delimiter(delimiter: str, word: str, text: str, where: str) -> InputError:
    rows = text.strip().splitlines()[1:2]
    decimal_comma = bool(rows) and "," in rows[0]
    script = f"s/,/./g; s/{delimiter}/,/g" if decimal_comma else f"s/{delimiter}/,/g"
    script = script.replace("\t", "\\t")
    return InputError(
        f"the columns are separated by {word}" + (" and decimals by commas" if decimal_comma else ""),
        where=f"{where}:1",
        expected="commas between columns, points in decimals",
        received=word,
        hint=f"sed -i.bak '{script}' {quoted(where)}",
    )


def _ragged(cells: list[str], names: tuple[str, ...], where: str) -> InputError:
    short = len(cells) < len(names)
    return InputError(
        f"a row has too {'few' if short else 'many'} cells",
        where=where,
        expected=f"{len(names)} cells, as in the header",
        received=f"{len(cells)}" + (f", nothing for {shown(names[len(cells)])}" if short else ""),
        hint="complete the row or take it out" + ("; a last line cut off by a crash can be deleted" if short else ""),
    )


def _fast(cells: list[str], values: array[float]) -> bool:
    """Append a row of plain numbers; False, and nothing appended, where a cell must be looked at."""
    try:
        row = [float(cell) for cell in cells]
    except ValueError:
        return False
    if math.inf in row or -math.inf in row:
        return False
    values.extend(row)
    return True


def _numbers(cells: list[str], values: array[float], names: tuple[str, ...], where: str) -> None:
    """Append the numbers of one row."""
    for column, cell in enumerate(cells):
        number = _number(cell)
        if number is None or math.isinf(number):
            infinite = number is not None
            blank = not cell.strip()
            raise InputError(
                "a cell is infinite" if infinite else "a cell is empty" if blank else "a cell is not a number",
                where=f"{where}, column {column + 1} ({shown(names[column])})",
                expected="a decimal number, or nan for what was not observed",
                received=shown(cell),
                hint="write nan where nothing was observed; units belong into the column's name",
            )
        values.append(number)


def _number(cell: str) -> float | None:
    """A plain decimal number; None for what only Python takes for one (1_000, digits of other scripts)."""
    try:
        number = float(cell)
    except ValueError:
        return None
    return number if "_" not in cell and cell.isascii() else None

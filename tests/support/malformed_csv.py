"""Malformed trajectory CSVs, in a fixed order."""

from __future__ import annotations

import codecs
import json
from collections.abc import Callable

from tests.support.import_samples import frame_json, small_csv
from tests.support.malformed import JUNK, Malformed

Row = list[str]


def _table(edit: Callable[[list[Row]], list[Row]]) -> bytes:
    """The good CSV with its table edited; row 0 is the header."""
    rows = edit([line.split(",") for line in small_csv().splitlines()])
    return ("\n".join(",".join(row) for row in rows) + "\n").encode()


def _each(edit: Callable[[Row], Row]) -> bytes:
    """The good CSV with every data row edited."""
    return _table(lambda rows: [rows[0], *(edit(row) for row in rows[1:])])


def _put(row: Row, column: int | slice, value: str | Row) -> Row:
    new = list(row)
    new[column] = value  # type: ignore[call-overload]
    return new


def _set(row: int, column: int, value: str) -> bytes:
    return _table(lambda rows: [_put(cells, column, value) if i == row else cells for i, cells in enumerate(rows)])


def _without_columns(*columns: int) -> bytes:
    return _table(lambda rows: [[cell for i, cell in enumerate(row) if i not in columns] for row in rows])


def _with_column(name: str, value: str = "0") -> bytes:
    return _table(lambda rows: [[*row, value if i else name] for i, row in enumerate(rows)])


def _scaled(factor: float, columns: slice) -> bytes:
    return _each(lambda row: _put(row, columns, [repr(factor * float(cell)) for cell in row[columns]]))


def _turned(row: Row, axes: tuple[int, int, int], signs: tuple[float, float, float]) -> Row:
    """A row with the axes of all caps exchanged and signed."""
    caps = [row[i : i + 3] for i in range(1, 19, 3)]
    return _put(row, _CAPS, [repr(sign * float(cap[k])) for cap in caps for k, sign in zip(axes, signs, strict=True)])


_CAPS, _TARGETS, _CONTROLS = slice(1, 19), slice(19, 25), slice(25, 31)


def csv_cases() -> list[Malformed]:
    """Malformed trajectory CSVs."""
    good = small_csv()
    raw = good.encode()
    lines = good.splitlines()
    header = lines[0]
    cases = [
        Malformed("empty", b""),
        Malformed("only_blanks", b" \n\n \n"),
        Malformed("only_bom", codecs.BOM_UTF8),
        Malformed("only_header", (header + "\n").encode()),
        Malformed("no_header", "\n".join(lines[1:]).encode()),
        Malformed("semicolons", good.replace(",", ";").encode()),
        Malformed("semicolons_decimal_comma", good.replace(",", ";").replace(".", ",").encode()),
        Malformed("tabs", good.replace(",", "\t").encode()),
        Malformed("bars", good.replace(",", "|").encode()),
        Malformed("blanks", good.replace(",", " ").encode()),
        Malformed("comment_line", ("# a comment\n" + good).encode()),
        Malformed("utf16", good.encode("utf-16")),
        Malformed("utf16_without_bom", good.encode("utf-16-le")),
        Malformed("utf32", good.encode("utf-32")),
        Malformed("latin1", raw.replace(b"t_s", "t_s\u00e9".encode("latin-1"))),
        Malformed("bad_utf8_in_cell", raw.replace(b"0.1,", b"0.1\xff,", 1)),
        Malformed("nul_byte", raw[:200] + b"\0" + raw[200:]),
        Malformed("nul_tail", raw + b"\0" * 4096),
        Malformed("binary", bytes(range(256)) * 20),
        Malformed("hdf5", b"\x89HDF\r\n\x1a\n" + raw),
        Malformed("gzip", b"\x1f\x8b\x08\0" + raw),
        Malformed("json", json.dumps(frame_json()).encode()),
        Malformed("html", b"<!doctype html><html><body>Not found</body></html>"),
        Malformed("open_quote", raw.replace(b"cap0_x_m", b'"cap0_x_m')),
        Malformed("open_quote_at_end", raw + b'"0.5,'),
        Malformed("text_after_quote", raw.replace(b"\n0.1,", b'\n"0.1"x,', 1)),
        Malformed("huge_cell", _set(3, 5, "1" * 200_000)),
        Malformed("huge_header_cell", raw.replace(b"cap0_x_m", b"c" * 200_000)),
        Malformed("many_columns", (",".join(f"c{i}" for i in range(5000)) + "\n").encode() + raw),
        Malformed("row_too_short", (good + "1.3,0.1\n").encode()),
        Malformed("row_too_long", good.replace("\n0.1,", "\n0.1,7,", 1).encode()),
        Malformed("trailing_comma", good.replace("\n", ",\n").encode()),
        Malformed("cut_in_last_row", raw[: raw.rstrip().rfind(b",", 0, len(raw) - 40)]),
        Malformed("duplicate_column", _set(0, 2, "cap0_x_m")),
        Malformed("unnamed_column", _set(0, 2, "")),
        Malformed("misspelt_column", _set(0, 1, "cap0_x_n")),
        Malformed("capitals", header.upper().encode() + b"\n" + "\n".join(lines[1:]).encode()),
        Malformed("misspelt_time", _set(0, 0, "time_s")),
        Malformed("no_unit", _set(0, 1, "cap0_x")),
        Malformed("mixed_units", _set(0, 1, "cap0_x_mm")),
        Malformed("unknown_column", _with_column("temperature")),
        Malformed("missing_time", _without_columns(0)),
        Malformed("missing_cap_axis", _without_columns(7)),
        Malformed("missing_target", _without_columns(21)),
        Malformed("missing_targets", _without_columns(*range(19, 25))),
        Malformed("missing_one_control", _without_columns(27)),
        Malformed("four_caps", _without_columns(*range(13, 19))),
        Malformed("eight_caps", _with_column("cap7_x_m")),
        Malformed("seven_targets", _with_column("target6")),
        Malformed("seven_controls", _with_column("control6")),
        Malformed("ten_lengths", _with_column("length9_m", "0.1")),
        Malformed("huge_cap_number", _with_column("cap99999999999999999999_x_m")),
        Malformed("empty_cell", _set(4, 6, "")),
        Malformed("blank_cell", _set(4, 6, "  ")),
        Malformed("nan_stamp", _set(4, 0, "nan")),
        Malformed("stamps_in_milliseconds_since_1970", _set(4, 0, "1676990000000000")),
        Malformed("far_cap", _set(4, 6, "1e6")),
        Malformed("overflowing_cap", _set(4, 6, "1e300")),
        Malformed("target_in_percent", _scaled(100.0, _TARGETS)),
        Malformed("target_below_zero", _set(5, 20, "-0.2")),
        Malformed("control_in_host_speeds", _set(5, 26, "70")),
        Malformed("decimetres", _scaled(10.0, _CAPS)),
        Malformed("centimetres", _scaled(100.0, _CAPS)),
        Malformed("millimetres", _scaled(1000.0, _CAPS)),
        Malformed("feet", _scaled(3.28084, _CAPS)),
        Malformed("other_robot", _scaled(0.295 / 0.325, _CAPS)),
        Malformed("all_caps_zero", _scaled(0.0, _CAPS)),
        Malformed("no_cap_observed", _each(lambda row: _put(row, 1, "nan"))),
        Malformed("time_backwards", ("\n".join([header, *reversed(lines[1:])]) + "\n").encode()),
        Malformed("y_up", _each(lambda row: _turned(row, (0, 2, 1), (1, 1, -1)))),
        Malformed("y_up_mirrored", _each(lambda row: _turned(row, (0, 2, 1), (1, 1, 1)))),
        Malformed("x_up", _each(lambda row: _turned(row, (2, 0, 1), (1, 1, 1)))),
        Malformed("z_down", _each(lambda row: _turned(row, (0, 1, 2), (1, -1, -1)))),
        Malformed("mirrored", _each(lambda row: _turned(row, (0, 1, 2), (1, -1, 1)))),
        Malformed("exchanged_ends", _each(lambda row: _put(row, slice(1, 7), [*row[4:7], *row[1:4]]))),
        Malformed("swapped_caps", _each(lambda row: _put(row, _CAPS, [*row[4:19], *row[1:4]]))),
        Malformed("bom", codecs.BOM_UTF8 + raw, accepted=True),
        Malformed("crlf", good.replace("\n", "\r\n").encode(), accepted=True),
        Malformed("bom_and_crlf", codecs.BOM_UTF8 + good.replace("\n", "\r\n").encode(), accepted=True),
        Malformed("no_final_newline", raw.rstrip(), accepted=True),
        Malformed("blank_lines", good.replace("\n", "\n\n").encode(), accepted=True),
        Malformed("quoted_cells", _set(2, 3, '"0.0175"'), accepted=True),
        Malformed("blanks_round_cells", good.replace(",", ", ").encode(), accepted=True),
        Malformed("nan_cap", _set(4, 6, "nan"), accepted=True),
        Malformed("nan_control", _set(4, 26, "NaN"), accepted=True),
        Malformed("without_control", _without_columns(*range(25, 31)), accepted=True),
        Malformed("other_order", _table(lambda rows: [row[::-1] for row in rows]), accepted=True),
        Malformed("one_row", "\n".join(lines[:2]).encode(), accepted=True),
        Malformed("one_duplicate_stamp", _set(5, 0, "0.31"), accepted=True),
    ]  # fmt: skip
    for i, junk in enumerate(JUNK):
        # Walk over time, cap, target and control columns, so that each kind meets much junk.
        column = (0, 5, 20, 28)[i % 4]
        cases.append(Malformed(f"junk_{i:02d}_in_column_{column}", _set(1 + i % 12, column, junk)))
    return cases

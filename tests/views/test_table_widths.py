"""Names of a table stay whole as long as another column can give way."""

from __future__ import annotations

import pytest

from r2s2r_cli.console import PIPED_WIDTH, Console
from r2s2r_cli.views.tables import table_text, table_widths

NAMES = ["001-turn-counterclockwise-2", "motor_speed_mismatch"]
LONG = "a remark of many words " * 4


def test_what_fits_is_left() -> None:
    """Every column as wide as its widest cell."""
    assert table_widths(["run", "end [mm]"], [["straight", "1.0"]], 100) == [8, 8]


@pytest.mark.parametrize("count", [1, 4, 9])
def test_a_name_is_not_cut_beside_long_columns(count: int, capsys: pytest.CaptureFixture[str]) -> None:
    """As it was in tables with many long columns; the words of those are whole too, while there is room."""
    Console().table("", ["name", *["what was seen"] * count], [[name, *[LONG] * count] for name in NAMES])
    lines = capsys.readouterr().out.splitlines()
    for name in NAMES:
        assert sum(line.strip().startswith(f"{name} ") for line in lines) == 1
    assert max(map(len, lines)) <= PIPED_WIDTH


def test_names_are_cut_last() -> None:
    """First the words of the others, and names only where a letter of each other column is left."""
    row = ["n" * 20, "x" * 50, "y" * 50]
    assert table_widths(["", "", ""], [row], 60) == [20, 20, 20]
    assert table_widths(["", "", ""], [row], 30) == [20, 5, 5]
    assert table_widths(["", "", ""], [row], 12) == [10, 1, 1]


def test_a_first_column_of_sentences_gives_way_too() -> None:
    """It may take a third of the room, beside columns that want all of it."""
    assert table_widths(["", ""], [[LONG, LONG]], 60)[0] == 30
    assert table_widths(["", ""], [["two words", LONG]], 30) == [9, 21]


def test_what_is_too_wide_stands_in_blocks() -> None:
    """Each beside the names of the rows, which the first column with no two equal cells has; in the width that there
    is, no word, no short cell and no heading in pieces. A later block has no row of which it says nothing."""
    columns = ["iteration", "stage", "artifact", "state", "size", "why"]
    paths = [f"iterations/00{k}/{name}.h5" for k in (1, 2) for name in ("10-record", "20-estimate")]
    rows = [[path[11:14], "estimate", path, "stale", "32.4 kB", ""] for path in paths]
    rows[1][-1] = f"input {paths[0]} is stale itself"
    text = table_text(columns, rows, 80)
    lines = [line.split() for line in text.splitlines()]
    assert max(map(len, text.splitlines())) <= 80
    assert lines[0] == ["artifact", "iteration", "stage", "state", "size"]
    assert [paths[0], "001", "estimate", "stale", "32.4", "kB"] in lines
    assert lines[7] == ["artifact", "why"] and len(lines) == 10 + 1  # sentences wrap
    assert [word for line in lines[9:] for word in line] == [paths[1], "input", paths[0], "is", "stale", "itself"]
    empty = [["001", "", ""], ["002", "", "so"]]
    assert "001" in table_text(["of", "x" * 30, "y" * 30], empty, 50)
    wide = table_text(columns, rows, 130).splitlines()
    assert wide[0].split() == columns and len(wide) == 6


def test_a_heading_of_many_lines_is_none() -> None:
    """Rather than that, its column goes into the next block."""
    columns = ["simulator", *[f"turn at the end in degrees, runs of {k}" for k in range(8)]]
    rows = [["initial", *"12345678"], ["iteration 1", *"23456789"]]
    text = table_text(columns, rows, 80)
    assert text.count("initial") > 1 and max(len(part.splitlines()) for part in text.split("\n\n")) <= 7
    assert "degrees," in text and "iteration 1" in text

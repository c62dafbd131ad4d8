"""Names of a table stay whole as long as another column can give way."""

from __future__ import annotations

import pytest

from r2s2r_cli.console import PIPED_WIDTH, Console, table_widths

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

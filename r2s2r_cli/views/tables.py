"""Tables in the width that there is: columns that do not fit side by side follow in blocks, one below the other."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from io import StringIO

GAP = 3
"""Characters between two columns; one stands at either edge."""
HEADING_LINES = 4
"""A heading may take so many lines before its column goes into the next block."""
SHORT = 16
"""Cells of so many characters are not wrapped: `32.4 kB`, `not identifiable`."""


def table_text(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int, *, terminal: bool = False) -> str:
    """A table of at most `width` columns of the terminal, without a title. Numbers (cells that begin like one) stand
    right.

    Where not all columns fit with their words whole, they follow in blocks, each beside the names of the rows; all but
    the first leave out rows of which they say nothing.
    """
    parts = list[str]()
    for block in blocks(columns, rows, width):
        shown = [[row[i] for i in block] for row in rows]
        if parts:
            shown = [row for row in shown if any(row[1:])]
        if shown or not parts:
            parts.append(_drawn([columns[i] for i in block], shown, width, terminal))
    return "\n\n".join(parts)


def blocks(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[list[int]]:
    """Which columns stand side by side: all, or the one that names the rows, first, and as many others as fit."""
    least = [_comfortable(name, [row[i] for row in rows]) for i, name in enumerate(columns)]
    if sum(least) <= _room(len(columns), width):
        return [list(range(len(columns)))]
    different = (i for i in range(len(columns)) if len({row[i] for row in rows}) == len(rows))
    names = next(different, 0)
    found: list[list[int]] = []
    for i in range(len(columns)):
        if i == names:
            continue
        wider = [*found[-1], i] if found else []
        if wider and sum(least[k] for k in wider) <= _room(len(wider), width):
            found[-1] = wider
        else:
            found.append([names, i])
    return found or [[names]]


def table_widths(columns: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> list[int]:
    """The width of every column, in characters of the terminal; together at most `room`, but at least one each.

    The widest gives way first, each as far as is comfortable, then as its longest word allows; the first one, which
    holds the names, after the others where it takes no more than a third. Words are cut where nothing else helps, those
    of the first column last.
    """
    from rich.cells import cell_len

    cells = [[name, *(row[i] for row in rows)] for i, name in enumerate(columns)]
    whole = [max(1, *(cell_len(line) for cell in column for line in cell.splitlines() or [""])) for column in cells]
    easy = [_comfortable(column[0], column[1:]) for column in cells]
    words = [_longest_word(column) for column in cells]
    widths, names = whole, max(words[0], min(whole[0], room // 3))
    last = ([names, *words[1:]], words, [words[0], *(1 for _ in words[1:])], [1] * len(words))
    for least in ([max(names, easy[0]), *easy[1:]], *last):
        widths = _narrowed(widths, least, room)
    return widths


def _room(count: int, width: int) -> int:
    return width - GAP * count + 1


def _comfortable(heading: str, cells: Sequence[str]) -> int:
    """The least width at which words and short cells are whole and the heading takes few lines."""
    from rich.cells import cell_len

    lines = [cell_len(line) for cell in cells for line in cell.splitlines()]
    width = max(_longest_word([heading, *cells]), *(count for count in lines if count <= SHORT), 1)
    while len(textwrap.wrap(heading, width)) > HEADING_LINES:
        width += 1
    return width


def _longest_word(cells: Sequence[str]) -> int:
    from rich.cells import cell_len

    return max(1, *(cell_len(word) for cell in cells for word in cell.split() or [""]))


def _narrowed(widths: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """One character less at a time of the widest column that is wider than its least width, until all have room."""
    narrow = list(widths)
    while sum(narrow) > room:
        wider = [i for i, width in enumerate(narrow) if width > least[i]]
        if not wider:
            break
        narrow[max(wider, key=lambda i: narrow[i])] -= 1
    return narrow


def _drawn(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int, terminal: bool) -> str:
    """One block, by rich; lines without the spaces at their ends where no terminal shows them."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    widths = table_widths(columns, rows, _room(len(columns), width))
    for i, name in enumerate(columns):
        numeric = bool(rows) and all(_is_number(row[i]) for row in rows)
        table.add_column(Text(name), justify="right" if numeric else "left", overflow="fold", width=widths[i])
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    # Rendered into a text and printed by others: rich ends the process by itself where a pipe closes.
    page = StringIO()
    Console(file=page, width=width, highlight=False, force_terminal=terminal).print(table)
    lines = page.getvalue().rstrip().splitlines()[1:]
    return "\n".join(lines if terminal else [line.rstrip() for line in lines])


def _is_number(cell: str) -> bool:
    return not cell or cell[0] in "-+0123456789"

"""The score of blind trials as Markdown, for a page that is kept beside the published file."""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.views.blind import blind_tables
from r2s2r_cli.views.page import PageTable
from schemas.results_blind import BlindScoreResult


def blind_markdown(result: BlindScoreResult) -> str:
    """Every table of the score as one of GitHub's Markdown, and the confusion matrix in words: a line a truth, with
    what was said of it and how often."""
    parts = [_table(table) for table in (*blind_tables(result), _confused(result)) if table.rows]
    return "\n\n".join([*parts, *result.warnings]) + "\n"


def _confused(result: BlindScoreResult) -> PageTable:
    rows = [
        [truth, ", ".join(f"{result.classes[j]} {count}" for j, count in enumerate(counts) if count)]
        for truth, counts in zip(result.classes, result.confusion, strict=True)
        if any(counts)
    ]
    return PageTable("first guesses: nothing wrong, clear single effects, clear ones outside the catalogue",
                     ["truth", "said"], rows)  # fmt: skip


def _table(table: PageTable) -> str:
    """A heading, and the table below it."""
    lines = [table.columns, ["---"] * len(table.columns), *table.rows]
    return "\n".join([f"## {_capital(table.title)}", "", *(_line(cells) for cells in lines)])


def _line(cells: Sequence[str]) -> str:
    """A bar in a cell would end it, and a line break the row."""
    return "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in cells) + " |"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]

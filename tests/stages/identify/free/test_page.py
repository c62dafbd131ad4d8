"""The page of free parameters."""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.stages.identify.free.catalogue import own_entries
from r2s2r_cli.stages.identify.free.page import free_parameters_page
from tests.support.engine import threebar

PAGE = Path(__file__).resolve().parents[4] / "docs" / "reference" / "free-parameters.md"


def test_the_committed_page_is_the_present_one() -> None:
    """docs/reference/free-parameters.md is what `make docs` would write."""
    assert PAGE.read_text(encoding="utf-8").endswith("\n\n" + free_parameters_page())


def test_every_name_has_its_row() -> None:
    """With a letter for the number of the element. Effects have theirs in the effects' own files."""
    page = free_parameters_page()
    for name in own_entries(threebar()):
        stem, _, last = name.rpartition(".")
        digits = last.removeprefix("cap")
        shown = [f"{stem}.{last.removesuffix(digits)}{letter}" for letter in "KR"] if digits.isdigit() else [name]
        assert any(f"| `{one}` |" in page for one in shown), name

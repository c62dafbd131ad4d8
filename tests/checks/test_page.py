"""The page of the checks."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from r2s2r_cli.checks import CHECKS
from r2s2r_cli.checks.base import Check, sentence
from r2s2r_cli.checks.docs import checks_page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "checks.md"


def test_the_committed_page_is_the_present_one() -> None:
    """docs/reference/checks.md is what `make docs` would write."""
    assert PAGE.read_text(encoding="utf-8").endswith("\n\n" + checks_page())


@pytest.mark.parametrize("entry", CHECKS, ids=lambda entry: entry.name)
def test_every_check_has_its_section(entry: Check) -> None:
    """Its section says importance, what, why and how to fix, and the table at the top leads there."""
    page = checks_page()
    section = re.split(r"^##", page.partition(f"### {entry.name}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
    assert section.strip().startswith(entry.importance.capitalize())
    assert sentence(entry.what) in section
    assert sentence(entry.why) in section
    assert "How to fix" in section
    assert f"[`{entry.name}`](#{entry.name})" in page


def test_what_mends_sensors_is_a_command() -> None:
    """That can be pasted: its words stand behind it as a remark."""
    hints = [entry.fix for entry in CHECKS if entry.fix.startswith("r2s2r calibrate --")]
    assert len(hints) == 4
    assert all(shlex.split(hint, comments=True) == ["r2s2r", "calibrate", "--points", "points.csv"] for hint in hints)
    assert not [entry.name for entry in CHECKS if entry.fix.startswith("r2s2r calibrate with")]

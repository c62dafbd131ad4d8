"""Documentation cannot rot: every command is documented, every generated page is the present one."""

from __future__ import annotations

import inspect
import re
import runpy
import sys
from pathlib import Path

import pytest

from tests.guards.listing import ROOT, commands, name, project_files

PAGES = [path for path in project_files() if path.suffix == ".md"]
ADRS = sorted((ROOT / "docs" / "adr").glob("[0-9]*.md"))


@pytest.mark.parametrize("command", sorted(commands()))
def test_help_ends_with_an_example(command: str) -> None:
    """The docstring of a command says what it does, and its last line is a command line that can be pasted."""
    lines = inspect.cleandoc(commands()[command].callback.__doc__ or "").splitlines()
    assert len(lines) > 2
    assert re.match(rf"(Example: +)?(\$ )?`?r2s2r (.* )?{command}\b", lines[-1].strip()), lines[-1]


@pytest.mark.parametrize("command", sorted(commands()))
def test_every_command_is_in_the_reference(command: str) -> None:
    """docs/reference/cli.md has a heading for every command."""
    page = (ROOT / "docs" / "reference" / "cli.md").read_text()
    assert re.search(rf"^#+ .*`r2s2r {command}`|^#+ `?{command}`?$", page, flags=re.MULTILINE)


@pytest.mark.parametrize("command", sorted(commands()))
def test_every_option_has_help(command: str) -> None:
    """Every option and argument of a command says what it does."""
    shown = [p for p in commands()[command].params if p.name != "help" and not getattr(p, "hidden", False)]
    assert [p.name for p in shown if not getattr(p, "help", None)] == []


@pytest.mark.parametrize("module", ["schemas.generate", "r2s2r_cli.docs"])
def test_generated_files_are_up_to_date(
    module: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What `make docs` writes, `python -m MODULE`, is what is committed."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", [module, "--check"])
    monkeypatch.delitem(sys.modules, module, raising=False)
    try:
        runpy.run_module(module, run_name="__main__")
    except SystemExit as end:
        assert not end.code, f"{end.code}\n{capsys.readouterr().out}"


def test_links_between_pages_lead_somewhere() -> None:
    """Every relative link of a page names a file or folder that exists."""
    links = [(page, target) for page in PAGES for target in re.findall(r"\]\(([^)#\s]+)", page.read_text())]
    relative = [(page, target) for page, target in links if not re.match(r"[a-z]+:", target)]
    assert relative
    assert [(name(page), target) for page, target in relative if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", ADRS, ids=name)
def test_decisions_are_short_and_complete(page: Path) -> None:
    """A decision record has at most 40 lines, and says context, decision and consequence."""
    text = page.read_text()
    assert len(text.splitlines()) <= 40
    assert re.findall(r"^## (\w+)", text, flags=re.MULTILINE) == ["Context", "Decision", "Consequence"]
    assert text.startswith(f"# {int(page.name[:4])}. ")


def test_decisions_are_numbered_without_gaps() -> None:
    """The numbers of the decision records run from 1 without a gap or a double."""
    assert [int(page.name[:4]) for page in ADRS] == list(range(1, len(ADRS) + 1))


def test_the_index_names_every_page() -> None:
    """docs/README.md links to every page under docs/."""
    index = (ROOT / "docs" / "README.md").read_text()
    pages = [page.relative_to(ROOT / "docs").as_posix() for page in PAGES if page.is_relative_to(ROOT / "docs")]
    assert [page for page in pages if page != "README.md" and f"({page})" not in index] == []

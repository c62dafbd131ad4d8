"""What pages and hints tell people to type is what the command line takes: commands, options, values."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.guards.listing import (
    ROOT,
    commands,
    inline_code,
    name,
    project_files,
    python_files,
    shell_commands,
    shell_lines,
)

PAGES = [path for path in project_files() if path.suffix == ".md"]
SHOWING = [page for page in PAGES if shell_commands(page.read_text())]
NAMING = [page for page in PAGES if any(code.startswith("r2s2r ") for code in inline_code(page.read_text()))]
OPTION = re.compile(r"(?<![\w-])--[a-z][\w-]*")
UNFINISHED = re.compile(r"Missing (argument|option)|Usage:|.*requires an argument")
"""Errors of a command that is named, not shown whole: `r2s2r inspect`."""


@cache
def _group() -> Any:
    import typer.main

    from r2s2r_cli.app import app

    return typer.main.get_group(app)


def _refused(words: Sequence[str]) -> str | None:
    """Why the command line does not take these words; None where it does. Nothing is run."""
    command: Any = _group()
    try:
        context = command.make_context("r2s2r", list(words))
        while hasattr(command, "commands") and (rest := [*context._protected_args, *context.args]):
            called, command, rest = command.resolve_command(context, rest)
            context = command.make_context(called, rest, parent=context)
    except typer.Exit:  # --help, --version
        return None
    except typer.TyperException as error:
        return error.format_message() if hasattr(error, "format_message") else str(error)
    return None


@pytest.mark.parametrize("page", SHOWING, ids=name)
def test_commands_in_code_blocks_are_taken(page: Path) -> None:
    """Every `r2s2r` command of a page's code blocks parses as it stands, with all its values."""
    shown = shell_commands(page.read_text())
    assert [(words, why) for words in shown if (why := _refused(words))] == []


@pytest.mark.parametrize("page", NAMING, ids=name)
def test_commands_in_the_text_are_taken(page: Path) -> None:
    """A command in a page's text parses too, but for arguments that it leaves out."""
    shown = [code for code in inline_code(page.read_text()) if code.startswith("r2s2r ")]
    refused = {code: why for code in shown if (why := _refused(shlex.split(code)[1:]))}
    assert {code: why for code, why in refused.items() if not UNFINISHED.match(why)} == {}


def test_files_in_code_blocks_exist() -> None:
    """A command that names a file of this project names one that is there."""
    words = {(name(page), word) for page in PAGES for line in shell_lines(page.read_text()) for word in line.split()}
    named = {at for at in words if re.match(r"(examples|docs|tests|schemas|r2s2r_cli)/[\w/.-]+$", at[1])}
    assert named
    assert [at for at in sorted(named) if not (ROOT / at[1]).exists()] == []


def test_hints_name_options_that_exist() -> None:
    """Where the source says `r2s2r COMMAND --option`, the command has the option: a hint can be pasted."""
    wrong = [
        (name(path), line, text)
        for path in python_files("r2s2r_cli", "schemas")
        for line, text in _mentions(path)
        if (options := _options(text)) is not None and not set(OPTION.findall(text)) <= options
    ]
    assert wrong == []


def test_hints_that_begin_with_a_command_are_one() -> None:
    """What is said beside the command stands behind a `#`: pasted, words of a sentence would be arguments."""
    hints = [(name(path), *hint) for path in python_files("r2s2r_cli", "schemas") for hint in _whole_hints(path)]
    assert len(hints) > 100
    refused = [(where, line, text, _refused(shlex.split(text, comments=True)[1:])) for where, line, text in hints]
    assert [row for row in refused if row[-1] and not UNFINISHED.match(row[-1])] == []


def _whole_hints(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every hint that is written out whole and begins with `r2s2r `."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.keyword) or node.arg != "hint" or not isinstance(node.value, ast.Constant):
            continue
        if (text := _text(node.value)).startswith("r2s2r "):
            yield node.value.lineno, text


def _options(text: str) -> set[str] | None:
    """What the command that a text begins with takes; None where no command of ours is named."""
    words = re.findall(r"[\w-]+", text)
    called = next((key for key in (" ".join(words[1:3]), " ".join(words[1:2])) if key in commands()), None)
    if called is None:
        return None
    return {text for one in commands()[called].params for text in (*one.opts, *one.secondary_opts)} | {"--help"}


def _mentions(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text from `r2s2r` on, to the end of the line or code, of every string; what is filled in is left out."""
    source = path.read_text()
    if "r2s2r " not in source:
        return
    tree = ast.parse(source)
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr | ast.Constant) and id(node) not in parts:
            for found in re.finditer(r"(?<![\w/.])r2s2r [^`\n]*", _text(node)):
                yield node.lineno, found[0]


def _text(node: ast.expr) -> str:
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def test_the_reader_of_pages_finds_every_command() -> None:
    """Blocks of other languages before it, indentation, pipes, settings and comments hide no command."""
    page = (
        "```python\nr2s2r no\n```\ntext\n```sh\n$ cd here && r2s2r status --json | tee r2s2r.txt  # r2s2r no\n```\n"
        "1. item\n   ```sh\n   A=1 r2s2r plan --to 1,2 \\\n     > out &\n   ```\n```text\nr2s2r no\n```\n"
    )
    assert shell_commands(page) == [["status", "--json"], ["plan", "--to", "1,2"]]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("r2s2r nosuch", "No such command"),
        ("r2s2r bench nosuch", "No such command"),
        ("r2s2r status --nosuch", "No such option"),
        ("r2s2r bench identify --cases many", "Invalid value"),
        ("r2s2r simulate --random many", "Invalid value"),
        ("r2s2r inspect", "Missing argument"),
    ],
)
def test_a_wrong_command_is_refused(line: str, why: str) -> None:
    """Neither commands nor options nor values that do not exist get past this guard; a whole command does."""
    assert (_refused(line.split()[1:]) or "").startswith(why)
    assert _refused(["status", "--json"]) is None
    assert _options("r2s2r blind make bank") == _options("r2s2r blind make")

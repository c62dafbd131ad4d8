"""Rules of the house that a reader can check by eye, checked for every file."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.guards.listing import name, python_files

MAX_LINES = 400
UNFINISHED = ["TO" + "DO", "FIX" + "ME", "XX" + "X:", "raise " + "NotImplemented"]
SOURCE = python_files("r2s2r_cli", "schemas", "tests", "examples")
TESTS = [path for path in python_files("tests") if path.name.startswith("test_")]


def functions_of(path: Path) -> Iterator[ast.FunctionDef]:
    """The test functions of a file, also those inside classes."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield node


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_every_test_says_what_it_proves(path: Path) -> None:
    """Every test function has a docstring."""
    assert [node.name for node in functions_of(path) if not (ast.get_docstring(node) or "").strip()] == []


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_a_test_file_has_tests(path: Path) -> None:
    """A file that is named as one of tests holds at least one, so that none is lost by a rename."""
    text = path.read_text()
    assert list(functions_of(path)) or "RuleBasedStateMachine" in text


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_no_two_functions_of_a_file_share_a_name(path: Path) -> None:
    """No test hides an earlier one of the same name in the same scope."""
    for scope in ast.walk(ast.parse(path.read_text())):
        if isinstance(scope, ast.Module | ast.ClassDef):
            names = [node.name for node in scope.body if isinstance(node, ast.FunctionDef)]
            assert len(names) == len(set(names))


def test_no_file_is_long() -> None:
    """One idea a file: no Python file has more than 400 lines."""
    lengths = {name(path): len(path.read_text().splitlines()) for path in SOURCE}
    assert {path: lines for path, lines in lengths.items() if lines > MAX_LINES} == {}


@pytest.mark.parametrize("word", UNFINISHED)
def test_nothing_is_left_unfinished(word: str) -> None:
    """No Python file holds a mark of unfinished work."""
    assert [name(path) for path in SOURCE if word in path.read_text()] == []

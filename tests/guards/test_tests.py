"""Rules of the house that a reader can check by eye, checked for every file."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

import pytest

from r2s2r_cli.blind.code import statements
from tests.guards.listing import ROOT, name, python_files

MAX_LINES = 400
UNFINISHED = ["TO" + "DO", "FIX" + "ME", "XX" + "X:", "raise " + "NotImplemented"]
SOURCE = python_files("r2s2r_cli", "schemas", "tests", "examples")
TESTS = [path for path in python_files("tests") if path.name.startswith("test_")]


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    """Every test file, parsed."""
    assert TESTS
    return {name(path): ast.parse(path.read_text()) for path in TESTS}


def functions_of(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """The test functions of a file, also those inside classes."""
    for node in statements(tree):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield node


def test_every_test_says_what_it_proves(trees: dict[str, ast.Module]) -> None:
    """Every test function has a docstring."""
    silent = [
        (path, node.name)
        for path, tree in trees.items()
        for node in functions_of(tree)
        if not (ast.get_docstring(node) or "").strip()
    ]
    assert silent == []


def test_a_test_file_has_tests(trees: dict[str, ast.Module]) -> None:
    """A file that is named as one of tests holds at least one, so that none is lost by a rename."""
    empty = [path for path, tree in trees.items() if not any(functions_of(tree))]
    assert [path for path in empty if "RuleBasedStateMachine" not in (ROOT / path).read_text()] == []


def test_no_two_functions_of_a_file_share_a_name(trees: dict[str, ast.Module]) -> None:
    """No test hides an earlier one of the same name in the same scope."""
    twice = []
    for path, tree in trees.items():
        for scope in statements(tree):
            if isinstance(scope, ast.Module | ast.ClassDef):
                names = Counter(node.name for node in scope.body if isinstance(node, ast.FunctionDef))
                twice += [(path, one) for one, count in names.items() if count > 1]
    assert twice == []


def test_no_file_is_long() -> None:
    """One idea a file: no Python file has more than 400 lines."""
    lengths = {name(path): len(path.read_text().splitlines()) for path in SOURCE}
    assert {path: lines for path, lines in lengths.items() if lines > MAX_LINES} == {}


@pytest.mark.parametrize("word", UNFINISHED)
def test_nothing_is_left_unfinished(word: str) -> None:
    """No Python file holds a mark of unfinished work."""
    assert [name(path) for path in SOURCE if word in path.read_text()] == []

"""Iterations are made one after the other: a number that skips some is a slip of the finger."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.project import Project
from tests.commands.conftest import invoke

CREATING = {
    "import": ("sample.csv",),
    "record": ("--random", "3", "--port", "socket://nowhere:1"),
    "identify": (),
    "plan": (),
    "simulate": ("--random", "3"),
    "run": ("sample.csv",),
}
"""Commands that begin an iteration."""


@pytest.mark.parametrize("command", CREATING)
@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
def test_a_number_that_skips_some_is_refused(estimated: Path, command: str, dry: tuple[str, ...]) -> None:
    """Exit code 2 and the command with the number that comes next, in a dry run as well; nothing is made."""
    result = invoke(command, *CREATING[command], "--iteration", "99", *dry)
    assert result.exit_code == 2, result.stderr
    assert "iteration 99 is not the next one\n  where: --iteration\n  expected: 2, which is the next" in result.stderr
    mended = " ".join(["r2s2r", command, *CREATING[command], "--iteration", "2", *dry])
    assert f"received: 99\nhint: {mended}\n" in result.stderr
    assert [path.name for path in (estimated / "iterations").iterdir()] == ["001"]


def test_the_next_one_and_one_that_was_removed_are_made(estimated: Path) -> None:
    """The number after the latest, and any before it."""
    here = Project.find(estimated)
    assert here.iteration(2, create=True).number == 2
    shutil.move(estimated / "iterations/001", estimated / "iterations/004")
    assert [here.iteration(number, create=True).number for number in (1, 3, 5)] == [1, 3, 5]
    with pytest.raises(UsageError, match="iteration 6 is not the next one"):
        here.iteration(6, create=True)


def test_the_first_one_is_number_one(project: Path) -> None:
    """In a project without any."""
    result = invoke("import", "sample.csv", "--iteration", "2")
    assert result.exit_code == 2 and "expected: 1, the first" in result.stderr
    assert Project.find(project).iterations() == []

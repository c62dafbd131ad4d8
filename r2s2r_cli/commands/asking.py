"""Whether somebody is there to be asked before a robot moves: found out before anything is computed."""

from __future__ import annotations

import sys

from r2s2r_cli.commands.typed import typed_again
from r2s2r_cli.errors import UsageError


def answered(*, yes: bool) -> bool:
    """Whether the question has an answer, or somebody who can give it."""
    return yes or sys.stdin.isatty()


def require_answer(command: str, *, yes: bool) -> None:
    """Raises UsageError where nobody is there to be asked whether the robot may move."""
    if not answered(yes=yes):
        raise UsageError("nobody is there to be asked whether the robot may move", where=f"r2s2r {command}",
                         expected="a terminal, or --yes", received="neither",
                         hint=typed_again(command, "--yes"))  # fmt: skip

"""One file a subcommand. A command is listed here when it works, not before.

The functions are imported when the app is built, so nothing heavy may be imported at the top of any of them.
"""

from __future__ import annotations

from collections.abc import Callable

import typer

from r2s2r_cli.commands.status import status

COMMANDS: dict[str, Callable[..., None]] = {
    "status": status,
}
"""Subcommands in the order of the data, then of use."""

GROUPS: dict[str, typer.Typer] = {}
"""Subcommands that have subcommands."""

"""One stage of `run`, and what its end means for the whole."""

from __future__ import annotations

import shlex
import signal
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

import typer

from r2s2r_cli.commands.run_child import STOPPED, ended
from r2s2r_cli.console import out
from r2s2r_cli.errors import ExitCode, Interrupted, R2S2RError


def carry_out(words: Sequence[str], shown: str, *, robot: bool, json: bool = False) -> None:
    """One command in a process of its own; its words are ours. Leaves with its code where it fails. robot: it moves
    one. json: its document is printed only then, as the one of the whole."""
    with tempfile.TemporaryFile() as document:
        streams: dict[str, Any] = {"stdout": document} if json else {}
        code, stopped = ended([*words, *["--json"] * json], robot=robot, **streams)
        document.seek(0)
        said = document.read().decode("utf-8", errors="replace").strip()
    if code < 0 and -code not in STOPPED:
        raise R2S2RError(
            f"the system ended the process of: {shown}", where="r2s2r run", expected="a stage that ends by itself",
            received=f"signal {-code}" + "; most often there was too little memory" * (code == -signal.SIGKILL),
            hint=shlex.join(["r2s2r", *sys.argv[1:]]),
        )  # fmt: skip
    # Stopped in its last moment it is done all the same; the next one is not begun.
    if code == ExitCode.INTERRUPTED or code < 0 or (stopped and code == ExitCode.DONE):
        raise Interrupted(f"stopped in: {shown}", hint=shlex.join(["r2s2r", *sys.argv[1:]]))
    if code != ExitCode.DONE:
        if said:
            out(said)
        raise typer.Exit(code)

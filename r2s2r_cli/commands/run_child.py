"""One stage of `run` in a process of its own, and what its end means for the whole."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

import typer

from r2s2r_cli.console import out
from r2s2r_cli.errors import ExitCode, Interrupted, R2S2RError

_STOPPED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals by which somebody stops a command; a child that another one ended has failed."""


def carry_out(words: Sequence[str], shown: str, *, json: bool = False) -> None:
    """One command in a process of its own, so that its memory is given back; its words are ours. Leaves with its code
    where it fails. json: its document is printed only then, as the one of the whole."""
    with tempfile.TemporaryFile() as document:
        told: dict[str, Any] = {"stdout": document} if json else {}
        with subprocess.Popen([sys.executable, "-m", "r2s2r_cli", *words, *["--json"] * json], **told) as child:
            try:
                code = child.wait()
            except KeyboardInterrupt:
                code = child.wait()  # it had the same signal, and stops what it does in its own way
        document.seek(0)
        said = document.read().decode("utf-8", errors="replace").strip()
    if code < 0 and -code not in _STOPPED:
        raise R2S2RError(
            f"the system ended the process of: {shown}", where="r2s2r run", expected="a stage that ends by itself",
            received=f"signal {-code}" + "; most often there was too little memory" * (code == -signal.SIGKILL),
            hint=shlex.join(["r2s2r", *sys.argv[1:]]),
        )  # fmt: skip
    if code == ExitCode.INTERRUPTED or code < 0:
        raise Interrupted(f"stopped in: {shown}", hint=shlex.join(["r2s2r", *sys.argv[1:]]))
    if code != ExitCode.DONE:
        if said:
            out(said)
        raise typer.Exit(code)

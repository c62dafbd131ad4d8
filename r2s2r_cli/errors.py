"""One error family. Every message says what, where, expected, received, and one pasteable hint."""

from __future__ import annotations

import importlib.util
from enum import IntEnum
from pathlib import Path
from shlex import quote


class ExitCode(IntEnum):
    """The process exit codes of `docs/reference/exit-codes.md`."""

    DONE = 0
    BUG = 1
    USAGE = 2
    GATE = 3
    INPUT = 4
    HARDWARE = 5
    NUMERICAL = 6
    INTERRUPTED = 130


EXIT_CODE_MEANING: dict[ExitCode, str] = {
    ExitCode.DONE: "done, or already up to date",
    ExitCode.BUG: "a bug in r2s2r: unexpected error, traceback on stderr",
    ExitCode.USAGE: "usage: unknown command, option, key, name or value, or a request that would lose data",
    ExitCode.GATE: "gate not met: `validate` found errors, `status --check` found stale or damaged artifacts",
    ExitCode.INPUT: "artifact, project or input missing, unreadable, damaged, or of the wrong kind or version",
    ExitCode.HARDWARE: "hardware or link failure, emergency stop",
    ExitCode.NUMERICAL: "numerical failure: not finite, not converged, not identifiable",
    ExitCode.INTERRUPTED: "interrupted (Ctrl-C, SIGTERM, a closed terminal); nothing is half-written, long work can be "
    "resumed; with --json stdout stays empty",
}


UPDATE_CLONE = "git pull && pip install -e .   # in your clone of r2s2r"
"""The command that brings r2s2r up to date, of a clone whose folder is not known: no package index has r2s2r."""


def quoted(path: object) -> str:
    """A path as it can be pasted into a shell, whatever its name."""
    return quote(str(path))


def nearest_folder(path: Path) -> Path:
    """The nearest folder above a path that is there: what a hint can list where the path itself is missing."""
    return next((folder for folder in path.parents if folder.is_dir()), Path())


def install_extra(extra: str) -> str:
    """The command that installs an extra. From the clone that this is: no package index has r2s2r."""
    root = Path(__file__).resolve().parents[1]
    if (root / "pyproject.toml").is_file():
        return f"pip install -e {quote(f'{root}[{extra}]')}"
    return f"pip install -e '.[{extra}]'   # in a clone of r2s2r"


class R2S2RError(Exception):
    """A failure that the user can act on. Never raised for bugs.

    what: one sentence, no full stop. where: file (and HDF5 path, or line and column), or option.
    expected / received: the two values that disagree, as text. hint: a command that can be pasted.
    """

    exit_code: ExitCode = ExitCode.BUG

    def __init__(self, what: str, *, hint: str, where: str = "", expected: str = "", received: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.expected = expected
        self.received = received
        self.hint = hint

    @property
    def facts(self) -> dict[str, str]:
        """What it is made from, by keyword: on its way between processes it is made again of them."""
        return {name: getattr(self, name) for name in ("what", "where", "expected", "received", "hint")}

    def lines(self) -> list[str]:
        """The message as it is printed, one fact a line, without the leading `error:`."""
        facts = [("where", self.where), ("expected", self.expected), ("received", self.received)]
        return [self.what, *(f"  {name}: {text}" for name, text in facts if text), f"hint: {self.hint}"]

    def __str__(self) -> str:
        return "\n".join(self.lines())


class UsageError(R2S2RError):
    """The request itself is wrong, or would overwrite something that cannot be made again."""

    exit_code = ExitCode.USAGE


class GateError(R2S2RError):
    """The command worked and printed its result, and what it checked did not pass.

    `exit_code` is another where what was checked could not even be read.
    """

    exit_code = ExitCode.GATE

    def __init__(self, what: str, *, exit_code: ExitCode = ExitCode.GATE, **facts: str) -> None:
        super().__init__(what, **facts)
        self.exit_code = exit_code


class InputError(R2S2RError):
    """A file that the user gave (CSV, TOML, JSON, folder) cannot be used as it is."""

    exit_code = ExitCode.INPUT


class Interrupted(R2S2RError):
    """Ctrl-C during long work of which something is kept: what, and the command that goes on."""

    exit_code = ExitCode.INTERRUPTED


class ArtifactError(InputError):
    """An artifact or the project is missing, damaged, or of another kind or version."""


class DamageWarning(UserWarning):
    """Bytes of a file changed, but nothing that can be read: the command goes on."""


class HardwareError(R2S2RError):
    """A port, camera or board failed; the robot has been told to stop where the protocol allows it."""

    exit_code = ExitCode.HARDWARE


class NumericalError(R2S2RError):
    """The numbers went wrong: not finite, not converged, not identifiable."""

    exit_code = ExitCode.NUMERICAL


def require_mujoco(where: str) -> None:
    """Raises InputError where MuJoCo is not installed, which the command `where` needs."""
    if importlib.util.find_spec("mujoco") is None:
        raise InputError("MuJoCo is not installed", where=where, expected="mujoco of the extra `rig`", received="none",
                         hint=install_extra("rig"))  # fmt: skip
